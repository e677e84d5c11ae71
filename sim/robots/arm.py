"""A six-joint arm on a pedestal behind the table, with the camera at its wrist."""

from dataclasses import dataclass

from sim.ranges import Degrees, File, Place
from sim.robot.robot import Damping
from sim.robots import mjcf

ELBOW_UP = (0.0, -1.2, 1.2, 0.0, 0.0, 0.0)
"""Joints [rad] near which every start lies: the elbow above the line from shoulder to wrist."""


@dataclass(frozen=True, slots=True)
class Config(mjcf.Config):
    """The kind `mjcf` with this model, its own camera and its home."""

    weakest: Damping = 0.1
    damping: Damping = 0.1
    model: File = "arm.xml"
    camera: str = "eye"
    base: tuple[Place, Place, Place, Degrees] = (0.0, 0.0, 0.0, 0.0)
    home: tuple[mjcf.Home, ...] = (ELBOW_UP,)
