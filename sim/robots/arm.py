"""Robot: an arm with six joints on a pedestal behind the table, with the camera at its wrist."""

from dataclasses import dataclass

import numpy as np

from sim.kinematics.robot import Design, Drives, Inversion
from sim.robots.mjcf import shipped

ELBOW_UP = (0.0, -1.2, 1.2, 0.0, 0.0, 0.0)
"""Joint positions [rad] at which the search for a start pose begins: the elbow is above the line
from shoulder to wrist."""
INVERSION = Inversion(weakest=0.1, damping=0.1)
"""Settings of the inverse kinematics, chosen by hand when the arm was added."""


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Settings of the six-joint arm: errors of its drives and encoders."""

    def build(self, rng: np.random.Generator) -> Design:
        """Return the design of the robot (model, drives and home positions) with these settings;
        `rng` is not used.
        """
        return shipped("arm.xml", self, (ELBOW_UP,), INVERSION)
