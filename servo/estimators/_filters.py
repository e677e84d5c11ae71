"""Small Kalman filters side by side, one for each feature, and the noise level that they learn.

Covariances are relative to a variance of each feature, its level. Gains depend on ratios only, so a
level changes no estimate; it decides how unlikely an innovation is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from sim.types import Array

Flags = NDArray[np.bool_]
MEMORY, FIRST = 60, 5
"""Frames over which a level is learned, and how many of them the given one counts for at first."""
MOST = 9.0
"""What one innovation may count for: a target that turns is no noise."""
LEAST = 0.01
"""The smallest level, over the given one."""


@dataclass(frozen=True, slots=True)
class Model:
    """The filter of one feature; its state has n numbers."""

    F: Array
    """Transition per frame (n, n)."""
    B: Array
    """What a known input adds per frame (n,)."""
    H: Array
    """The measurement (n,)."""
    Q: Array
    """Process noise per frame (n, n)."""
    R: float
    """Variance of the measurement's white noise."""
    P: Array
    """Covariance (n, n) after the first measurement."""


@final
class Filters:
    """States x (k, n) and covariances (k, n, n) of k features."""

    def __init__(self, model: Model, count: int) -> None:
        """States of zero."""
        self.model = model
        self.x = np.zeros((count, len(model.H)))
        self.covariance = np.repeat(model.P[None], count, axis=0)

    def predict(self, u: Array) -> None:
        """Go on by a frame, with a known input (k,)."""
        m = self.model
        self.x = self.x @ m.F.T + np.outer(u, m.B)
        self.covariance = m.F @ self.covariance @ m.F.T + m.Q

    @property
    def expected(self) -> Array:
        """What the next measurement should be (k,)."""
        return self.x @ self.model.H

    @property
    def S(self) -> Array:
        """Variance (k,) of the next innovation."""
        H = self.model.H
        return (self.covariance @ H) @ H + self.model.R

    def update(self, innovation: Array, measured: Flags) -> None:
        """Correct the features that were measured, by their innovations (k,)."""
        PH = self.covariance @ self.model.H
        K = np.where(measured[:, None], PH / self.S[:, None], 0.0)
        self.x = self.x + K * np.where(measured, innovation, 0.0)[:, None]
        P = self.covariance - K[:, :, None] * PH[:, None, :]
        self.covariance = (P + P.transpose(0, 2, 1)) / 2


@final
class Level:
    """Variance (k,) of each feature's noise, learned from innovations, older ones discounted.

    After West and Harrison, Bayesian Forecasting and Dynamic Models, 2nd edition, Springer 1997,
    sections 4.5 and 10.8: a tracker's noise differs between targets, and between one that rests and
    one that moves over a ground.
    """

    def __init__(self, given: Array) -> None:
        """Begin with these variances (k,)."""
        self.value, self._least = given.copy(), LEAST * given
        self._frames = np.full(len(given), float(FIRST))

    def learn(self, ratio: Array, measured: Flags, but: Flags | None = None) -> Array:
        """NIS (k,) of innovations whose squares over the filter's variance S are given; nan where
        nothing was measured. The level changes afterwards, except for those in `but`.
        """
        nis = np.where(measured, ratio / self.value, np.nan)
        learns = measured if but is None else measured & ~but
        self._frames = np.minimum(self._frames + learns, MEMORY)
        change = np.where(learns, (np.minimum(nis, MOST) - 1) / self._frames, 0.0)
        self.value = np.maximum(self.value * (1 + change), self._least)
        return nis
