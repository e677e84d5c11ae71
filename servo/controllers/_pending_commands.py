"""Record of commanded twists that have not acted yet, with a forecast of how much of each the
robot's limits will allow.
"""

from collections import deque
from math import ceil
from typing import final

import numpy as np

from sim.types import Array, Posture

WHOLE_FRAMES = 1e-6
"""Excess of a latency over whole frame intervals that counts as rounding [frame intervals]."""
WHOLE = 1 - 1e-6
"""Share from which a command counts as fully accepted: rates and twists are rounded."""


@final
class PendingCommands:
    """The commanded twist that acted until the last picture, and those that will act after it, for
    a robot whose commands act late.
    """

    def __init__(self, latency: float) -> None:
        """Create the record of a robot at rest.

        Args:
            latency: Delay from a picture to the effect of its command [frame intervals].
        """
        count = ceil(latency - WHOLE_FRAMES)
        self._twists = deque([np.zeros(6)] * (count + 1), maxlen=count + 1)
        self._first = latency - (count - 1)

    def add(self, twist: Array) -> None:
        """Append the twist (6,) [m/s, rad/s] that was commanded after the newest picture."""
        self._twists.append(twist)

    def coming(self, posture: Posture, dt: float) -> list[tuple[Array, float]]:
        """Return the camera twists (6,) [m/s, rad/s] that will act from now until the next command
        does, the earliest first, each with its duration over dt.

        If the drives accepted only a share of the last command, because a joint is at a limit, no
        later twist is expected to have a larger component along that command.

        Args:
            posture: State of the robot; `accepted` is the twist that its drives accepted.
            dt: Time since the last picture [s].
        """
        # Oldest first: `acted` moved the camera until the last picture, `own` are still to act.
        acted, *own = self._twists
        shares = [self._first, *[1.0] * len(own)]
        coming = list(zip(own, shares, strict=False))
        # The loop states what is under way if delays are no whole frames, or twists are replaced.
        if posture.under_way is not None:
            coming = [(twist, held / dt) for twist, held in posture.under_way]
        acted = acted if posture.asked is None else posture.asked
        asked = float(acted @ acted)
        if posture.accepted is None or asked == 0.0:
            return coming
        # The accepted part of the command, along its direction.
        most = max(0.0, float(posture.accepted @ acted))
        if most >= WHOLE * asked:
            return coming
        along = [float(twist @ acted) for twist, _ in coming]
        factors = [most / a if a > most else 1.0 for a in along]
        return [(t * f, share) for (t, share), f in zip(coming, factors, strict=True)]
