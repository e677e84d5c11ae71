"""A 6-DOF gantry over the table: three slides, and a wrist whose axes meet in the camera."""

from dataclasses import dataclass

from sim.ranges import Degrees, File, Place
from sim.robot.robot import Damping
from sim.robots import mjcf


@dataclass(frozen=True, slots=True)
class Config(mjcf.Config):
    """The kind `mjcf` with this model, its own camera and its home."""

    weakest: Damping = 0.1
    damping: Damping = 0.1
    model: File = "gantry.xml"
    camera: str = "eye"
    base: tuple[Place, Place, Place, Degrees] = (0.0, 0.0, 0.0, 0.0)
    home: tuple[mjcf.Home, ...] = ((0.0,) * 6,)
