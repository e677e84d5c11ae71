"""The filter of kalman_cv, restarted where the target's velocity jumps (CUSUM, Page 1954).

Two sums for each feature run over the innovation nu, divided by its standard deviation:

    g+ = max(0, g+ + nu - drift)    g- = max(0, g- - nu - drift)

Where one passes the threshold the velocity has jumped: the filter takes its velocity anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from servo.estimators._error_filter import ErrorFilters, TargetModel
from servo.estimators._filters import Flags
from servo.estimators._kalman import Memory, Ratio, between
from servo.estimators.kalman_cv import RATIO_AT_5_HZ, RHO, motion
from sim.types import Array

RATIO_AT_30_HZ = 0.15
"""Tuned sQ / sR: between the jumps too, the velocity of a target that weaves changes."""


@dataclass(frozen=True, slots=True)
class Config:
    """The filter's constants, and those of the test."""

    rho: Memory = RHO
    """Memory of the velocity's change from frame to frame."""
    ratio: Ratio | None = None
    """sQ / sR, per frame; by default what suits the camera's rate."""
    drift: Annotated[float, Ge(0), Le(1e6)] = 0.75
    """What the innovation may be without being summed, in standard deviations."""
    threshold: Annotated[float, Ge(0.001), Le(1e6)] = 3.5
    """The sum that is a jump, in standard deviations."""

    def build(self, rng: np.random.Generator) -> ErrorFilters:
        """The estimator; draws nothing."""
        test = Cusum(self.drift, self.threshold)
        return ErrorFilters(self.model, test=test)

    def model(self, dt: float) -> TargetModel:
        """How a target moves, at a frame interval [s]."""
        ratio = self.ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt)
        return motion(dt, self.rho, ratio)


@final
class Cusum:
    """Cumulative sums in both directions."""

    def __init__(self, drift: float, threshold: float) -> None:
        self._drift = drift
        self._threshold = threshold
        self._sums = np.zeros((2, 1))

    def jumped(self, normalised: Array) -> Flags:
        """Where a sum passed the threshold (k,); it is zero again then."""
        both = np.stack([normalised, -normalised])
        self._sums = np.maximum(0.0, self._sums + both - self._drift)
        found = np.any(self._sums > self._threshold, axis=0)
        self._sums[:, found] = 0.0
        return found
