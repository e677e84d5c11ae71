"""Robot: a gantry with six joints over the table, three slides and a wrist whose axes meet in the
camera.
"""

from dataclasses import dataclass

import numpy as np

from sim.kinematics.robot import Design, Drives, Inversion
from sim.robots.mjcf import shipped

MIDDLE = (0.0,) * 6
INVERSION = Inversion(weakest=0.1, damping=0.1)
"""Chosen by hand, as for the arm; its only singular pose has the wrist tilted by a right angle."""


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Settings of the gantry: errors of its drives and encoders."""

    def build(self, rng: np.random.Generator) -> Design:
        """Return the design of the robot (model, drives and home positions) with these settings;
        `rng` is not used.
        """
        return shipped("gantry.xml", self, (MIDDLE,), INVERSION)
