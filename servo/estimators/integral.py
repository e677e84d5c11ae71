"""The integral part of a proportional-integral law: the sum of the errors stands for the target's
motion (P. I. Corke, M. C. Good, Dynamic effects in visual closed-loop systems, 1996).
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
    """With a law of gain g, twist = -L^+ (g e + gain * integral of e)."""

    gain: Annotated[float, Ge(0), Le(1000)] = 2.0
    """Of the integral [1/s^2]."""

    def build(self, rng: np.random.Generator) -> "Integral":
        """Return the estimator, which uses no random numbers."""
        return Integral(self.gain)


@final
class Integral:
    """Errors times their interval, summed; those of features that are not fed forward count
    nothing.
    """

    def __init__(self, gain: float) -> None:
        self._gain = gain

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._sum = np.zeros(len(features.names))

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the gain times the integral; a feature that is not measured adds nothing."""
        shown = np.nan_to_num(error)
        self._sum = self._sum + shown * dt
        return Prediction.unmeasured(shown, self._gain * self._sum)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the integral, kept."""
        return Prediction.unmeasured(np.zeros_like(self._sum), self._gain * self._sum)
