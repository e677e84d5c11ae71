"""Is the target still there? A robust threshold on the distance, with hysteresis: one for all
trackers.
"""

import math
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
CLEAR = 0.08
"""At a distance below this, nothing begins to hide the target."""
SURE = 6.0
"""A rise by fewer robust standard deviations than this is chance."""
JUMP = 0.03
"""What an estimate deviates from the prediction is chance below this: position over the target's
size, or ln scale."""


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
    sudden: Annotated[float, Ge(0), Le(1000)] = 0.0
    """A distance this many times the median of recent good frames is not believed at first, even
    below the floor, if the target seems to jump as well: so it is where something begins to hide
    it and draws the estimate along. 0: it is believed."""
    doubt: Time = 0.3
    """After this long such a distance is believed: the light has changed [s]."""


class Lock:
    """Judges each frame's distance by the good frames before it."""

    def __init__(self, config: LockConfig) -> None:
        self._config = config
        self._good: deque[float] = deque(maxlen=config.history)
        self._unseen_since: float | None = None
        self._risen_since: float | None = None

    @property
    def threshold(self) -> float:
        """The largest distance that is believed, between floor and cap.

        The median of the good frames plus `sigmas` robust standard deviations; the cap while there
        are only a few.
        """
        c = self._config
        if len(self._good) < FEW:
            return c.cap
        middle, sigma = self._usual()
        return min(max(middle + c.sigmas * sigma, c.floor), c.cap)

    @property
    def locked(self) -> bool:
        """Whether the last frame was good."""
        return self._unseen_since is None

    def judge(self, distance: float, time: float, jump: float = math.inf) -> Status:
        """The status after a frame.

        Args:
            distance: From the target.
            time: Of the frame [s].
            jump: Of the estimate from the prediction: position over the target's size, or ln scale,
                whichever is larger; by default of a tracker that predicts nothing.
        """
        limit = self.threshold * (1.0 if self.locked else self._config.hysteresis)
        if distance > limit:
            self._risen_since = None
        elif not self._begins_to_hide(distance, time, jump):
            self._good.append(distance)
            self._unseen_since = None
            return Status.LOCKED
        if self._unseen_since is None:
            self._unseen_since = time
        waited = time - self._unseen_since
        return Status.LOST if waited >= self._config.patience else Status.UNSURE

    def _begins_to_hide(self, distance: float, time: float, jump: float) -> bool:
        """Whether the distance has risen suddenly, with a jump, a moment ago."""
        c = self._config
        risen = False
        if c.sudden > 0 and len(self._good) >= FEW:
            middle, sigma = self._usual()
            risen = distance > max(CLEAR, c.sudden * middle, middle + SURE * sigma)
        if not risen:
            self._risen_since = None
        elif self._risen_since is None and jump > JUMP:
            self._risen_since = time
        return self._risen_since is not None and time - self._risen_since < c.doubt

    def _usual(self) -> tuple[float, float]:
        """Median and robust standard deviation of the recent good frames' distances."""
        good = np.array(self._good)
        middle = _median(good)
        return middle, MAD_TO_SIGMA * _median(np.abs(good - middle))


def _median(values: Array) -> float:
    """The median; a fraction of the cost of `np.median`, which is for arrays of any shape."""
    ordered = np.sort(values)
    half = len(values) // 2
    return float(ordered[half] + ordered[-half - 1]) / 2
