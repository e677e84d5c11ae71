"""A camera that moves freely and makes every twist exactly, without limits of speed or tilt."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated

from annotated_types import Ge, Le

from sim.ranges import Degrees, File, Place
from sim.robots import mjcf

HOMES = tuple((0.0, 0.0, 1.0, 0.0, 0.0, k * pi / 2) for k in range(4))
"""A metre above the table, in four directions: a half turn away the search has no direction."""


@dataclass(frozen=True, slots=True)
class Config(mjcf.Config):
    """The kind `mjcf` with this model, its own camera and its homes."""

    weakest: Annotated[float, Ge(1e-6), Le(100)] = 0.001
    damping: Annotated[float, Ge(1e-6), Le(100)] = 0.001
    exact: bool = True
    model: File = "free.xml"
    camera: str = "eye"
    base: tuple[Place, Place, Place, Degrees] = (0.0, 0.0, 0.0, 0.0)
    home: tuple[mjcf.Home, ...] = HOMES
