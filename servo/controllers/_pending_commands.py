"""Commands that do not act yet, and how much of them the robot's limits will let through."""

from collections import deque
from math import ceil
from typing import final

import numpy as np

from sim.types import Array, Posture

WHOLE_FRAMES = 1e-6
"""A latency that is longer than whole frame intervals by less than this is rounded."""
WHOLE = 1 - 1e-6
"""A share from here on counts as all of it: rates and twists are rounded."""


@final
class PendingCommands:
    """The last commands: the one that acted until the last picture, and those that come."""

    def __init__(self, latency: float) -> None:
        """Begin with none; each acts this many frame intervals after it was asked for."""
        count = ceil(latency - WHOLE_FRAMES)
        self._twists = deque([np.zeros(6)] * (count + 1), maxlen=count + 1)
        self._first = latency - (count - 1)

    def add(self, twist: Array) -> None:
        """Ask for a twist (6,)."""
        self._twists.append(twist)

    def coming(self, posture: Posture, dt: float) -> list[tuple[Array, float]]:
        """Return the twists (6,) that will act before the next command does, the next one first,
        and how long each will, over the interval dt [s] since the last picture.

        Where the drives accepted only a part of the last command, because a joint is at its limit,
        they will accept no more of another one in its direction.
        """
        acted, *own = self._twists
        shares = [self._first, *[1.0] * len(own)]
        coming = list(zip(own, shares, strict=False))
        if posture.under_way is not None:
            coming = [(twist, held / dt) for twist, held in posture.under_way]
        acted = acted if posture.asked is None else posture.asked
        asked = float(acted @ acted)
        if posture.accepted is None or asked == 0.0:
            return coming
        most = max(0.0, float(posture.accepted @ acted))
        if most >= WHOLE * asked:
            return coming
        along = [float(twist @ acted) for twist, _ in coming]
        factors = [most / a if a > most else 1.0 for a in along]
        return [(t * f, share) for (t, share), f in zip(coming, factors, strict=True)]
