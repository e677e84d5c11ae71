"""A 6-DOF gantry over the table: three slides, and a wrist whose axes meet in the camera."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

import mujoco
import numpy as np

from sim.robot import Design, Drives


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Its drives."""

    def build(self, rng: np.random.Generator) -> Design:
        """The robot; draws nothing."""
        spec = mujoco.MjSpec.from_file(str(resources.files("scenes") / "gantry.xml"))
        return Design("gantry.xml", spec, drives=self, homes=((0.0,) * 6,))
