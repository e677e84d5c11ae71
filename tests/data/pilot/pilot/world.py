"""A red cushion, a slower gantry, and a motion that swings."""

from dataclasses import dataclass
from math import cos, tau

import mujoco
import numpy as np

from servo import Pose
from sim.models.target import Target, rectangle
from sim.robots import gantry

CUSHION = """
<mujoco>
  <worldbody>
    <geom type="box" size=".08 .05 .02" pos="0 0 .02" rgba=".8 .1 .1 1"/>
    <body><geom type="sphere" size=".015" pos="0 0 .045" rgba=".9 .9 .2 1"/></body>
  </worldbody>
</mujoco>"""


@dataclass(frozen=True, slots=True)
class Cushion:
    """A red cushion with a yellow button."""

    def build(self, rng):
        outline = rectangle(np.array([0.0, 0.0, 0.04]), 0.16, 0.10)
        return Target(mujoco.MjSpec.from_string(CUSHION), outline)


@dataclass(frozen=True, slots=True)
class SlowGantry(gantry.Config):
    """The gantry, with all its drives at half their speed."""

    share: float = 0.5
    """Share of the gantry's speeds."""

    def build(self, rng):
        # super() needs the class's own cell, which dataclasses with slots do not have.
        design = gantry.Config.build(self, rng)
        for actuator in design.spec.actuators:
            actuator.ctrlrange = self.share * np.array(actuator.ctrlrange)
        return design


@dataclass(frozen=True, slots=True)
class Swing:
    """To and fro along x."""

    width: float = 0.05
    """Amplitude [m]."""
    period: float = 8.0
    """Time of one swing [s]."""

    def build(self, rng):
        return Pendulum(self)


class Pendulum:
    def __init__(self, config):
        self._config = config

    def at(self, time):
        c = self._config
        return Pose.planar(c.width * (1 - cos(tau * time / c.period)), 0.0, 0.0)
