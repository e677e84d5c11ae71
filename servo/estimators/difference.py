"""The plain difference (Teuliere, Marchand, Eck, equation 18): what the camera's motion does not
explain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features import half_turn
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, rng: np.random.Generator) -> Difference:
        """The estimator; draws nothing."""
        return Difference()


@final
class Difference:
    """(e_k - e_{k-1}) / dt - L v, where v is the camera's measured motion over that very interval.

    Pairing the difference with the last command instead, one frame off, makes the loop diverge.
    """

    def __init__(self) -> None:
        self._last: Array | None = None
        self.value = np.zeros(4)

    def update(self, error: Array, own: Array, dt: float) -> Array:
        """The estimate (4,); zero until there are two frames in a row."""
        if self._last is not None:
            change = error - self._last
            change[3] = half_turn(change[3])
            self.value = change / dt - own
        self._last = error
        return self.value

    def skip(self) -> Array:
        """The last estimate (4,); the next difference begins anew."""
        self._last = None
        return self.value

    @property
    def ready(self) -> bool:
        """Whether an error is at hand from which the next update can measure."""
        return self._last is not None
