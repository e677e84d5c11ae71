"""The target drives back and forth on a straight line at constant speed and reverses at once
(the experiment of Teuliere, Marchand and Eck, section VI).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import final

import numpy as np

from sim.ranges import Degrees, Length, Place, Speed
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """The line and the speed."""

    x: Place = 0.0
    """Middle of the line [m]."""
    y: Place = 0.0
    """Middle of the line [m]."""
    heading_deg: Degrees = -90.0
    """Direction of the nose and of the first drive, from world x towards y [deg]."""
    speed: Speed = 0.1
    """Speed [m/s]."""
    length: Length = 0.5
    """Length of the line [m]; the drive starts in its middle."""

    def build(self, rng: np.random.Generator) -> Reversal:
        """The motion; draws nothing."""
        return Reversal(self)


@final
class Reversal:
    """A triangle wave along the heading; the nose never turns."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        c = self._config
        driven = (c.speed * time + c.length / 2) % (2 * c.length)
        way = min(driven, 2 * c.length - driven) - c.length / 2
        heading = radians(c.heading_deg)
        return Pose.planar(c.x + way * cos(heading), c.y + way * sin(heading), heading)
