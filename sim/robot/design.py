"""The design of a robot: its model before it is put into the room, and how it is driven."""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
from annotated_types import Ge, Le

from sim.ranges import EachPlay
from sim.types import Pose

EYE = "eye"
"""Name of the camera in a robot's model, and of the site in its optical centre."""
CAMERA = f"robot/{EYE}"
"""Their name in the scene."""


@dataclass(frozen=True, slots=True)
class Drives:
    """Errors of a robot's drives and encoders."""

    encoder_noise: EachPlay = 0.0
    """Standard deviation of each reading of a joint, one for all or one each [m or rad]."""
    encoder_step: EachPlay = 0.0
    """Joints are read in whole steps of this, one for all or one each [m or rad]."""
    backlash: EachPlay = 0.0
    """Play between motor and joint, one for all or one each [m or rad]: a motor that reverses turns
    so far, and its encoder with it, until the joint follows."""
    lag_ms: Annotated[float, Ge(0), Le(1000)] = 0.0
    """Time constant with which a drive takes over a new rate, before its own servo [ms]."""


@dataclass(frozen=True, slots=True)
class Inversion:
    """The way from a camera twist to joint rates."""

    weakest: float = 0.02
    """Below this smallest singular value of the Jacobian [m/s or rad/s of the camera per unit of
    joint rate] the inverse is damped."""
    damping: float = 0.02
    """Damping in a singular pose; the camera then moves less than asked for, and another way."""
    centring: float = 1.0
    """With more than six joints: how fast those with limits move towards the middle between them
    [1/s], as far as this does not move the camera (Liegeois 1977)."""
    exact: bool = False
    """Take the rates that bring the camera exactly to where the twist leads by the next update of
    the drives; otherwise those that the twist needs at the beginning are held until then."""


@dataclass(frozen=True, slots=True)
class Design:
    """A robot before it is put into the room."""

    name: str
    """Name of its model in messages, such as "gantry.xml"."""
    spec: mujoco.MjSpec
    """Its model, with a camera and a site `eye`, and one velocity actuator for each joint."""
    drives: Drives
    """Errors of its drives and encoders."""
    homes: tuple[tuple[float, ...], ...]
    """Joint positions from which all others are sought, one after another [m or rad]; where there
    are none, from everywhere."""
    base: Pose = field(default_factory=lambda: Pose.planar(0.0, 0.0, 0.0))
    """T_room_base: where it stands; the room's z is up, and the table's top at z = 0."""
    inversion: Inversion = Inversion()
    """How its joints follow a camera twist."""
