"""The integral part of a proportional-integral law: the sum of the errors replaces an estimate of
the target's motion (P. I. Corke, M. C. Good, Dynamic effects in visual closed-loop systems, 1996).
"""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Gain of the integral: with a law of gain g, twist = -L^+ (g e + gain * integral of e)."""

    gain: Annotated[float, Ge(0), Le(1000)] = 2.0
    """Gain of the integral [1/s^2]."""

    def build(self, rng: np.random.Generator) -> "Integral":
        """Return the estimator, which uses no random numbers."""
        return Integral(self.gain)


@final
class Integral:
    """Sums errors times their frame interval; the law uses the sums of features that it feeds
    forward.
    """

    def __init__(self, gain: float) -> None:
        self._gain = gain

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set."""
        self._sum = np.zeros(len(features.names))

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the gain times the integral of the error as the motion; features that are not
        measured keep their sum.
        """
        shown = np.nan_to_num(error)
        self._sum = self._sum + shown * dt
        return Prediction.unmeasured(shown, self._gain * self._sum)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the unchanged integral times the gain."""
        return Prediction.unmeasured(np.zeros_like(self._sum), self._gain * self._sum)
