"""Robot: a camera that only turns, by pan and tilt about axes that meet in its centre; at zero it
looks straight down.

Its pictures of a scene can be computed exactly from those of a fixed camera with the same centre,
such as the camera of a recording (`sim.recording`).
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.kinematics.robot import Design, Drives, Inversion
from sim.ranges import check
from sim.robots.mjcf import shipped

Turn = Annotated[float, Ge(-85), Le(85)]
INVERSION = Inversion(weakest=0.01, damping=0.01)
"""Settings of the inverse kinematics, chosen by hand: within 85 degrees of tilt the pan axis is not
parallel to the optical axis."""


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Settings of the turning camera: ranges of pan, to the right, and tilt, upwards [deg], and
    errors of drives and encoders. In a recording the ranges by default end where the view would
    leave the recording.
    """

    pan: tuple[Turn, Turn] = (-85.0, 85.0)
    """Range of the turn to the right about the picture's vertical [deg]."""
    tilt: tuple[Turn, Turn] = (-85.0, 85.0)
    """Range of the turn upwards [deg]."""

    def __post_init__(self) -> None:
        for name, (low, high) in {"pan": self.pan, "tilt": self.tilt}.items():
            check((low >= high, f"{name} = [{low:g}, {high:g}]: the first should be smaller"))

    def build(self, rng: np.random.Generator) -> Design:
        """Return the design of the robot (model, drives and home positions) with these settings;
        `rng` is not used.
        """
        middles = [np.radians(sum(each) / 2).item() for each in (self.pan, self.tilt)]
        design = shipped("turning_head.xml", self, (tuple(middles),), INVERSION)
        spec = design.spec.copy()
        for name, limits in {"pan": self.pan, "tilt": self.tilt}.items():
            spec.joint(name).range = np.radians(limits)
        return replace(design, spec=spec)
