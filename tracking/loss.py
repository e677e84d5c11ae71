"""Detection of target loss: a robust threshold, with hysteresis, on the distance of the picture
from the target's appearance.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

from tracking.types import Status

# Chosen by hand on the shipped scenarios.
SIGMAS = 3.0
"""Robust standard deviations by which the threshold lies above the median of good frames."""
MAD_TO_SIGMA = 1.4826
"""Ratio of standard deviation and median absolute deviation of a normal distribution."""
HISTORY = 60
"""Number of good frames that count as recent: two seconds at 30 Hz."""
FEW = 10
"""With fewer good frames the threshold is the cap, because their spread is not yet known."""

# These four were chosen on runs of `occlusion` and `occlusion_partial` with drawn starts, in which
# a board slides over the target between two frames (scenes/RESULTS.md).
CLEAR = 0.08
"""Largest distance at which the target is certainly not being hidden."""
SURE = 6.0
"""A rise of the distance by fewer robust standard deviations is chance."""
JUMP = 0.03
"""A smaller deviation of the estimate from the prediction is chance: of position, as a share of the
target's size, or of ln scale."""
DOUBT = 0.3
"""Time after which a suddenly risen distance is accepted as a change of the light [s]."""


@dataclass(frozen=True, slots=True)
class LossLimits:
    """Settings of `LossJudge`: bounds (`floor`, `cap`) of the threshold of the appearance distance,
    0..1, above which a target counts as not seen; the share of the threshold below which it counts
    as seen again (`hysteresis`); the time without it after which it is LOST (`patience`) [s]; and
    the factor on the usual distance above which a rise is sudden (`sudden`; 0: not tested).
    """

    floor: float = 0.25
    """Smallest threshold of the distance."""
    cap: float = 0.5
    """Largest threshold of the distance."""
    hysteresis: float = 0.8
    """A target that was not seen counts as seen again below this fraction of the threshold."""
    patience: float = 1.0
    """Time without the target after which the status is LOST [s]; before that it is UNSURE."""
    sudden: float = 0.0
    """Factor on the median distance of recent good frames. A target with a distance above the
    product (also above `CLEAR`, and above the median by `SURE` robust standard deviations) counts
    as not seen for up to `DOUBT` s, even below the floor, if the estimate jumps as well: this
    happens when an occluder begins to hide the target and pulls the estimate along. 0: no such
    check."""


class LossJudge:
    """Decides frame by frame whether the target is seen: it compares the distance of the picture
    from the target's appearance, 0..1, with a threshold that follows from the distances in recent
    frames in which the target was seen ("good frames").
    """

    def __init__(self, limits: LossLimits) -> None:
        self._limits = limits
        self._good: deque[float] = deque(maxlen=HISTORY)
        self._usual: tuple[float, float] | None = None
        self._unseen_since: float | None = None
        self._risen_since: float | None = None

    @property
    def threshold(self) -> float:
        """Threshold of the distance from the target's appearance, 0..1, above which a target that
        was seen in the last frame counts as not seen: the median of the distances in the last 60
        frames in which it was seen plus 3 robust standard deviations, clipped to the limits `floor`
        and `cap`. It is `cap` before the target was seen in 10 frames.
        """
        if len(self._good) < FEW:
            return self._limits.cap
        middle, sigma = self._usual_distance()
        return min(max(middle + SIGMAS * sigma, self._limits.floor), self._limits.cap)

    @property
    def locked(self) -> bool:
        """True if the last frame was LOCKED; also before the first frame."""
        return self._unseen_since is None

    def judge(self, distance: float, time: float, jump: float = math.inf) -> Status:
        """Return the status of a frame: LOCKED if the target is seen, else UNSURE, or LOST after
        `patience` s in which it was not seen.

        It is seen if the distance is at most `threshold`; after a frame in which it was not, at
        most `hysteresis` times `threshold`. If the limit `sudden` is above 0, a target also counts
        as not seen for up to 0.3 s after a sudden rise of the distance together with a jump, as
        long as the distance stays high.

        Args:
            distance: Distance from the target's appearance, 0..1; inf if the target was not found.
            time: Time of the frame [s].
            jump: Deviation of the estimate from the tracker's prediction: of position, as a share
                of the target's size, or of ln scale, whichever is larger; inf for a tracker without
                prediction.
        """
        limit = self.threshold * (1.0 if self.locked else self._limits.hysteresis)
        if not distance <= limit:  # nan is not
            # A target that comes out of hiding may be hidden suddenly again.
            self._risen_since = None
        elif not self._begins_to_hide(distance, time, jump):
            self._good.append(distance)
            self._usual = None
            self._unseen_since = None
            return Status.LOCKED
        if self._unseen_since is None:
            self._unseen_since = time
        return Status.LOST if time - self._unseen_since >= self._limits.patience else Status.UNSURE

    def _begins_to_hide(self, distance: float, time: float, jump: float) -> bool:
        """Return True if the distance rose suddenly, with a jump, less than `DOUBT` s ago, and has
        not fallen again.
        """
        sudden = self._limits.sudden
        risen = False
        if sudden > 0 and len(self._good) >= FEW:
            middle, sigma = self._usual_distance()
            risen = distance > max(CLEAR, sudden * middle, middle + SURE * sigma)
        if not risen:
            self._risen_since = None
        elif self._risen_since is None and jump > JUMP:
            self._risen_since = time
        return self._risen_since is not None and time - self._risen_since < DOUBT

    def _usual_distance(self) -> tuple[float, float]:
        """Return median and robust standard deviation of the distances of recent good frames."""
        if self._usual is None:
            middle = median(self._good)
            deviations = [abs(good - middle) for good in self._good]
            self._usual = middle, MAD_TO_SIGMA * median(deviations)
        return self._usual
