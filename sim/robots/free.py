"""Robot: a camera that moves freely and makes every commanded twist exactly, without limits of
speed or tilt, unless the settings give its drives and encoders errors.

Only where its wrist is singular (the camera looks level, along the diagonal x = y of the table) the
twist is not exact. Its position stays within 50 m of the room's origin on each axis.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from sim.kinematics.robot import Design, Drives, Inversion
from sim.robots.mjcf import shipped

HOMES = tuple((0.0, 0.0, 1.0, 0.0, 0.0, k * pi / 2) for k in range(4))
"""Joint positions [m, m, m, rad, rad, rad] at which the search for a start pose begins: 1 m above
the table, turned in four directions, as the search could not find a way to a pose that is a half
turn away."""
INVERSION = Inversion(weakest=0.001, damping=0.001, exact=True)
"""Its joints have no limits of rate: damping only keeps numbers finite in a singular pose."""


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Settings of the freely moving camera: errors of its drives and encoders, by default none."""

    def build(self, rng: np.random.Generator) -> Design:
        """Return the design of the robot (model, drives and home positions) with these settings;
        `rng` is not used.
        """
        return shipped("free.xml", self, HOMES, INVERSION)
