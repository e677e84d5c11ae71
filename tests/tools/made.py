"""Parts made by a function, for tests of what parts may get wrong."""

import math
from dataclasses import dataclass

import numpy as np

from tracking.types import Estimate, State, Status, check_region, unknown_covariance


def config_for(make):
    """A `Config` class whose build gives what a function makes."""

    @dataclass(frozen=True)
    class Config:
        def build(self, rng):
            return make(rng)

    return Config


class Good:
    """A tracker that sees a blue target, and changes nothing."""

    def __init__(self, rng):
        self.rng = rng

    def start(self, frame, region, state):
        check_region(frame, region, state)
        self.state = state

    def update(self, frame, ego=None):
        red, _, blue = np.moveaxis(frame.image.astype(int), -1, 0)
        rows, columns = np.nonzero(blue > red + 100)
        seen = len(rows) > 0
        if seen:
            self.state = State(columns.mean() + 0.5, rows.mean() + 0.5)
        status = Status.LOCKED if seen else Status.LOST
        return Estimate(self.state, unknown_covariance(), float(not seen), status)


class Centre:
    """The centroid as features, right by the textbook for a target parallel to the image."""

    names, units, noise = ("x", "y"), ("1", "1"), np.full(2, 1e-3)
    feed_forward, sole_dof = ("x",), {}

    def values(self, sight):
        return np.array([sight.moments.xg, sight.moments.yg])

    def matrix(self, sight):
        from servo.features._interaction import interaction

        m = sight.moments  # xn = an xg with an = K / sqrt(a): differentiate the quotient
        L, an = interaction(m, sight.plane, 1.0), 1 / math.sqrt(m.area)
        return np.array([(L[0] - m.xg * L[2]) / an, (L[1] - m.yg * L[2]) / an])

    def error(self, values, goal):
        return values - goal

    def known(self, sight):
        return np.array([True, True])

    def scales(self, goal):
        return np.ones(2)


def features(**changes):
    @dataclass(frozen=True)
    class Config:
        def build(self, outline):
            return type("Changed", (Centre,), changes)()

    return Config
