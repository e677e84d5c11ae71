"""The plain difference (Teuliere, Marchand, Eck, equation 18): what the camera's motion does not
explain.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """No settings."""

    def build(self, rng: np.random.Generator) -> "Plain":
        """Return the estimator; it draws nothing."""
        return Plain()


@final
class Difference:
    """(e_k - e_{k-1}) / dt - L v, where v is the camera's measured motion over that very interval.

    Pairing the difference with the last command instead, one frame off, makes the loop diverge.
    """

    def __init__(self, features: FeatureSet) -> None:
        self._features = features
        self.forget()
        self.value = np.zeros(len(features.names))

    def measure(self, error: Array, own: Array, dt: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return the difference (k,) after a frame, and for which features it is new: those that
        were measured, not nan, in this frame and in the last one. The others keep theirs, at first
        zero.
        """
        fresh = np.isfinite(error) & np.isfinite(self._last)
        now, last = (np.where(fresh, e, 0.0) for e in (error, self._last))
        self.value = np.where(fresh, self._features.error(now, last) / dt - own, self.value)
        self._last = error
        return self.value, fresh

    def forget(self) -> None:
        """Begin the next difference anew: the target was not seen."""
        self._last = np.full(len(self._features.names), np.nan)


@final
class Plain:
    """The difference as it is."""

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._difference = Difference(features)

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the last measurement."""
        motion, _ = self._difference.measure(error, own.past, dt)
        return Prediction.unmeasured(np.nan_to_num(error), motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the last measurement, kept."""
        self._difference.forget()
        return Prediction.unmeasured(np.zeros_like(self._difference.value), self._difference.value)
