"""Judgement whether the target is still there: a robust threshold on the distance, with
hysteresis, for all trackers.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

from tracking.types import Status

# Chosen by hand on the shipped scenarios.
SIGMAS = 3.0
"""Robust standard deviations above the median of recent good frames: the threshold."""
MAD_TO_SIGMA = 1.4826
"""Standard deviation of normal numbers over their median absolute deviation."""
HISTORY = 60
"""Number of good frames that count as recent: two seconds at 30 Hz."""
FEW = 10
"""With fewer good frames than this the threshold is the cap: their spread is not yet known."""

# These four were chosen on runs of `occlusion` and `occlusion_partial` with drawn starts, in which
# a board slides over the target between two frames (scenes/RESULTS.md).
CLEAR = 0.08
"""At a distance below this, nothing begins to hide the target."""
SURE = 6.0
"""A rise by fewer robust standard deviations than this is chance."""
JUMP = 0.03
"""A smaller deviation of the estimate from the prediction is chance: position over the target's
size, or ln scale."""
DOUBT = 0.3
"""After this long a distance that has risen suddenly is believed: the light has changed [s]."""


@dataclass(frozen=True, slots=True)
class LossLimits:
    """Limits that decide when a distance is too large to be the target."""

    floor: float = 0.25
    """The threshold is never below this distance."""
    cap: float = 0.5
    """The threshold is never above this distance."""
    hysteresis: float = 0.8
    """The target is believed again below this fraction of the threshold."""
    patience: float = 1.0
    """After this long without the target it is LOST [s]."""
    sudden: float = 0.0
    """A distance this many times the median of recent good frames is not believed at first, even
    below the floor, if the target seems to jump as well: so it is where something begins to hide
    it and draws the estimate along. 0: it is believed."""


class LossJudge:
    """Judge of each frame's distance by the good frames before it."""

    def __init__(self, limits: LossLimits) -> None:
        self._limits = limits
        self._good: deque[float] = deque(maxlen=HISTORY)
        self._unseen_since: float | None = None
        self._risen_since: float | None = None

    @property
    def threshold(self) -> float:
        """Largest distance that is believed: the median of the good frames plus `SIGMAS` robust
        standard deviations, between floor and cap; the cap while there are only a few.
        """
        if len(self._good) < FEW:
            return self._limits.cap
        middle, sigma = self._usual()
        return min(max(middle + SIGMAS * sigma, self._limits.floor), self._limits.cap)

    @property
    def locked(self) -> bool:
        """True if the last frame was good."""
        return self._unseen_since is None

    def judge(self, distance: float, time: float, jump: float = math.inf) -> Status:
        """Return the status after a frame.

        Args:
            distance: Distance of the appearance from the target's, 0..1; inf: it was not found.
            time: Time of the frame [s].
            jump: Deviation of the estimate from the prediction: position over the target's size,
                or ln scale, whichever is larger; by default that of a tracker without prediction.
        """
        limit = self.threshold * (1.0 if self.locked else self._limits.hysteresis)
        if not distance <= limit:  # nan is not
            # What comes out of hiding is doubted anew.
            self._risen_since = None
        elif not self._begins_to_hide(distance, time, jump):
            self._good.append(distance)
            self._unseen_since = None
            return Status.LOCKED
        if self._unseen_since is None:
            self._unseen_since = time
        return Status.LOST if time - self._unseen_since >= self._limits.patience else Status.UNSURE

    def _begins_to_hide(self, distance: float, time: float, jump: float) -> bool:
        """Return whether the distance has risen suddenly, with a jump, less than `DOUBT` ago."""
        sudden = self._limits.sudden
        risen = False
        if sudden > 0 and len(self._good) >= FEW:
            middle, sigma = self._usual()
            risen = distance > max(CLEAR, sudden * middle, middle + SURE * sigma)
        if not risen:
            self._risen_since = None
        elif self._risen_since is None and jump > JUMP:
            self._risen_since = time
        return self._risen_since is not None and time - self._risen_since < DOUBT

    def _usual(self) -> tuple[float, float]:
        """Return median and robust standard deviation of the recent good frames' distances."""
        middle = median(self._good)
        return middle, MAD_TO_SIGMA * median(abs(good - middle) for good in self._good)
