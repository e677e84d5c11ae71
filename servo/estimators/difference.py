"""The plain difference (Teuliere, Marchand, Eck, equation 18): what the camera's motion does not
explain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, rng: np.random.Generator) -> Plain:
        """The estimator; draws nothing."""
        return Plain()


@final
class Difference:
    """(e_k - e_{k-1}) / dt - L v, where v is the camera's measured motion over that very interval.

    Pairing the difference with the last command instead, one frame off, makes the loop diverge.
    """

    def __init__(self, features: FeatureSet) -> None:
        self._features = features
        self._last: Array | None = None
        self.value = np.zeros(len(features.names))

    def measure(self, error: Array, own: Array, dt: float) -> Array:
        """The difference (k,) after a frame; zero until there are two frames in a row."""
        if self._last is not None:
            self.value = self._features.error(error, self._last) / dt - own
        self._last = error
        return self.value

    def forget(self) -> None:
        """The target was not seen: the next difference begins anew."""
        self._last = None

    @property
    def ready(self) -> bool:
        """Whether an error is at hand from which the next one can be measured."""
        return self._last is not None


@final
class Plain:
    """The difference as it is."""

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._difference = Difference(features)

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """The last measurement."""
        return Prediction.unmeasured(error, self._difference.measure(error, own.past, dt))

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """The last measurement, kept."""
        self._difference.forget()
        return Prediction.unmeasured(np.zeros_like(self._difference.value), self._difference.value)
