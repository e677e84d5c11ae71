"""The commands that are under way, and how much of them the robot's limits will let through."""

from __future__ import annotations

from collections import deque
from typing import final

import numpy as np

from sim.types import Array, Posture

WHOLE = 1 - 1e-6
"""A share from here on is all of it: rates and twists are rounded."""


@final
class UnderWay:
    """The last commands: the one that acted until the last picture, and those that come."""

    def __init__(self, latency: int) -> None:
        """None so far; each acts this many frames after it was asked for."""
        self._twists = deque([np.zeros(6)] * (latency + 1), maxlen=latency + 1)

    def add(self, twist: Array) -> None:
        """Ask for a twist (6,)."""
        self._twists.append(twist)

    def coming(self, posture: Posture) -> list[Array]:
        """The twists (6,) that will act before the next command does, the next one first.

        Where the drives accepted only a part of the last command, for a joint is at its limit, they
        will accept no more of another one in its direction.
        """
        acted, *coming = self._twists
        asked = float(acted @ acted)
        if posture.accepted is None or asked == 0.0:
            return coming
        most = max(0.0, float(posture.accepted @ acted))
        if most >= WHOLE * asked:
            return coming
        along = [float(twist @ acted) for twist in coming]
        return [t * (most / a if a > most else 1.0) for t, a in zip(coming, along, strict=True)]
