"""Is the target still there? A robust threshold on the distance, with hysteresis: one for all
trackers.
"""

from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share, Time
from sim.types import Array
from tracking.types import Status

MAD_TO_SIGMA = 1.4826
FEW = 10
"""With fewer good frames than this the threshold is the cap: their spread says nothing yet."""


@dataclass(frozen=True, slots=True)
class LockConfig:
    """When a distance is too large to be the target."""

    floor: Share = 0.25
    """The threshold is never below this distance."""
    cap: Annotated[float, Ge(0.001), Le(1)] = 0.5
    """The threshold is never above this distance."""
    sigmas: Annotated[float, Ge(0), Le(1000)] = 3.0
    """Robust standard deviations above the median of recent good frames."""
    history: Annotated[int, Ge(3), Le(10_000)] = 60
    """How many good frames count as recent."""
    hysteresis: Annotated[float, Ge(0.001), Le(1)] = 0.8
    """The target is believed again below this fraction of the threshold."""
    patience: Time = 1.0
    """After this long without the target it is LOST [s]."""


class Lock:
    """Judges each frame's distance by the good frames before it."""

    def __init__(self, config: LockConfig) -> None:
        self._config = config
        self._good: deque[float] = deque(maxlen=config.history)
        self._unseen_since: float | None = None

    @property
    def threshold(self) -> float:
        """The largest distance that is believed, between floor and cap.

        The median of the good frames plus `sigmas` robust standard deviations; the cap while there
        are only a few.
        """
        c = self._config
        if len(self._good) < FEW:
            return c.cap
        good = np.array(self._good)
        middle = _median(good)
        sigma = MAD_TO_SIGMA * _median(np.abs(good - middle))
        return min(max(middle + c.sigmas * sigma, c.floor), c.cap)

    @property
    def locked(self) -> bool:
        """Whether the last frame was good."""
        return self._unseen_since is None

    def judge(self, distance: float, time: float) -> Status:
        """The status after a frame with this distance at this time [s]."""
        limit = self.threshold * (1.0 if self.locked else self._config.hysteresis)
        if distance <= limit:
            self._good.append(distance)
            self._unseen_since = None
            return Status.LOCKED
        if self._unseen_since is None:
            self._unseen_since = time
        waited = time - self._unseen_since
        return Status.LOST if waited >= self._config.patience else Status.UNSURE


def _median(values: Array) -> float:
    """The median; a fraction of the cost of `np.median`, which is for arrays of any shape."""
    ordered, half = np.sort(values), len(values) // 2
    return float(ordered[half] + ordered[-half - 1]) / 2
