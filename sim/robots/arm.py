"""A six-joint arm on a pedestal behind the table, with the camera at its wrist."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

import mujoco
import numpy as np

from sim.robot import Design, Drives

ELBOW_UP = (0.0, -1.2, 1.2, 0.0, 0.0, 0.0)
"""Joints [rad] near which every start lies: the elbow above the line from shoulder to wrist."""


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Its drives."""

    def build(self, rng: np.random.Generator) -> Design:
        """The robot; draws nothing."""
        spec = mujoco.MjSpec.from_file(str(resources.files("scenes") / "arm.xml"))
        return Design("arm.xml", spec, drives=self, homes=(ELBOW_UP,))
