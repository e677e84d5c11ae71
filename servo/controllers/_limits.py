"""Limits of speed and acceleration that keep the direction asked for."""

from __future__ import annotations

from math import hypot
from typing import final

import numpy as np

from sim.types import Array


@final
class Limits:
    """Shortens twists, and changes of twists, as a whole: never one part of them alone."""

    def __init__(
        self,
        speed: float,
        turn: float,
        acceleration: float | None,
        acceleration_turn: float | None,
    ) -> None:
        """Begin at rest, with limits in m/s, rad/s, m/s^2 and rad/s^2; None: there is none."""
        self._speed = speed
        self._turn = turn
        self._most_change = None
        if acceleration is not None or acceleration_turn is not None:
            self._most_change = (acceleration or np.inf, acceleration_turn or np.inf)
        self._last = np.zeros(6)

    def apply(self, twist: Array, dt: float) -> tuple[Array, bool]:
        """The twist (6,) that is allowed now, and whether it differs from the one asked for."""
        allowed = twist / max(1.0, excess(twist, self._speed, self._turn))
        if self._most_change is not None:
            change = allowed - self._last
            hurry = excess(change, *(dt * most for most in self._most_change))
            if hurry > 1.0:
                allowed = self._last + change / hurry
        self._last = allowed
        return allowed, bool((allowed != twist).any())


def excess(twist: Array, speed: float, turn: float) -> float:
    """How many times as fast as allowed."""
    vx, vy, vz, wx, wy, wz = twist.tolist()
    return max(hypot(vx, vy, vz) / speed, hypot(wx, wy, wz) / turn)
