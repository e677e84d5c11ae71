"""A 6-DOF gantry over the table: three slides, and a wrist whose axes meet in the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.robot import Design, Drives


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Its drives."""

    def build(self, rng: np.random.Generator) -> Design:
        """The robot; draws nothing."""
        return Design("gantry.xml", home=(0.0,) * 6, drives=self)
