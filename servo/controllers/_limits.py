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
        self._speed, self._turn = speed, turn
        self._acceleration = np.inf if acceleration is None else acceleration
        self._acceleration_turn = np.inf if acceleration_turn is None else acceleration_turn
        self._last = np.zeros(6)

    def apply(self, twist: Array, dt: float) -> tuple[Array, bool]:
        """The twist (6,) that is allowed now, and whether it is another one."""
        allowed = twist / max(1.0, _excess(twist, self._speed, self._turn))
        change = allowed - self._last
        most = dt * self._acceleration, dt * self._acceleration_turn
        hurry = _excess(change, *most)
        if hurry > 1.0:
            allowed = self._last + change / hurry
        self._last = allowed
        return allowed, bool((allowed != twist).any())


def _excess(twist: Array, speed: float, turn: float) -> float:
    """How many times as fast as allowed."""
    vx, vy, vz, wx, wy, wz = twist.tolist()
    return max(hypot(vx, vy, vz) / speed, hypot(wx, wy, wz) / turn)
