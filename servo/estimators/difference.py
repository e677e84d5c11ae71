"""The plain difference (Teuliere, Marchand, Eck, equation 18): what the camera's motion does not
explain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features import half_turn
from servo.types import Outlook, OwnMotion
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

    def __init__(self) -> None:
        self._last: Array | None = None
        self.value = np.zeros(4)

    def measure(self, error: Array, own: Array, dt: float) -> Array:
        """The difference (4,) after a frame; zero until there are two frames in a row."""
        if self._last is not None:
            change = error - self._last
            change[3] = half_turn(change[3])
            self.value = change / dt - own
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

    def __init__(self) -> None:
        self._difference = Difference()

    def update(self, error: Array, own: OwnMotion, dt: float) -> Outlook:
        """The last measurement."""
        return Outlook.plain(error, self._difference.measure(error, own.past, dt))

    def skip(self, own: OwnMotion, dt: float) -> Outlook:
        """The last measurement, kept."""
        self._difference.forget()
        return Outlook.plain(np.zeros(4), self._difference.value)
