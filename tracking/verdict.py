"""The decision whether a tracker is on its target, from colours, a correlation filter and the first
picture: the confidence, and the status that follows from it.
"""

import math
from dataclasses import dataclass

from tracking.types import Status

# Bias and the weights of answer and distance: a logistic regression of right against off pictures
# of 21 annotated targets and their turned versions, rounded (tests/benchmarks/witness.py fits it
# again; tracking/RESULTS.md has the figures with each recording left out). The weights of the two
# signs that compare with the usual were set by hand: without them something painted with just the
# target's colours is taken for it, and on the recordings they do no harm.
BIAS = 1.4
"""Constant term of the logit of the confidence."""
BY_ANSWER = 5.0
"""Weight of the slow correlation filter's answer."""
BY_DISTANCE = -6.7
"""Weight of the distance of the colours, 0..1."""
BY_SHARE = 2.0
"""Weight of the filter's answer as a share of its usual one, up to 1."""
BY_FALL = -1.5
"""Weight of the fall of the correlation with the first picture, from the usual one."""
ALIKE = 0.35
"""Distance of the colours below which a place is not more like the target: its own pictures differ
by so much."""
LEARNED = 0.1
"""Weight of a trusted frame in what is usual: it follows a target that turns or deforms slowly."""
LEAST = 0.03
"""Least usual answer by which another is divided."""
MOST = 4.0
"""Largest absolute logit of one frame, so that one frame does not outweigh those around it."""
MEMORY = 0.15
"""Time over which the logit is smoothed [s]."""
HELD = 0.5
"""Least confidence of a target that stays LOCKED."""
REGAINED = 0.75
"""Least confidence of a target that becomes LOCKED again: once it was doubted, something else may
have taken its place, and has been learned for a while."""
GONE = 0.1
"""Confidence below which the target is LOST."""
SEARCHED = 0.5
"""Time without being LOCKED after which the target is searched in the whole picture [s]."""
AHEAD = 0.5
"""Least lead of another place's logit over that of the tracker's own place."""


@dataclass(frozen=True, slots=True)
class Signs:
    """Measures of how much one place in one frame looks like the target: output of the slowly
    learning correlation filter (`answer`, up to about 1); correlation with the target's first
    picture (`first`, -1..1); and distance of the colours from the target's (`distance`, 0..1).
    """

    answer: float
    """Answer of the slow correlation filter, up to about 1."""
    first: float
    """Correlation with the first picture of the target, -1..1."""
    distance: float
    """Distance of the colours, 0..1."""


class Verdict:
    """Decides frame by frame, from the measures `Signs` of the tracker's place, how confident it
    is, 0..1, that the tracker is on its target, and the status LOCKED, UNSURE or LOST.
    """

    def __init__(self) -> None:
        self._usual: Signs | None = None
        self._logit = 0.0
        self._time = -math.inf
        self._unseen_since: float | None = None
        self.trusted = True
        """True if the last frame by itself, without those before, rather shows the target: only
        then it is learned."""
        self.status = Status.LOCKED
        """Status of the last frame."""

    def searches(self, time: float) -> bool:
        """Return True if at a time [s] the target has not been LOCKED for at least 0.5 s: then the
        caller searches the whole picture for it.
        """
        return self._unseen_since is not None and time - self._unseen_since >= SEARCHED

    def logit(self, signs: Signs) -> float:
        """Return the logit ln(p / (1 - p)), clipped to -4..4, of the confidence p that the target
        is at the place with these signs, by one frame alone. Nothing is stored.
        """
        usual = self._usual or signs
        share = min(max(signs.answer / max(usual.answer, LEAST), 0.0), 1.0)
        fall = min(max(usual.first - signs.first, 0.0), 1.0)
        logit = BIAS + BY_ANSWER * signs.answer + BY_SHARE * share + BY_FALL * fall
        return min(max(logit + BY_DISTANCE * max(signs.distance, ALIKE), -MOST), MOST)

    def convinces(self, other: Signs, own: Signs) -> bool:
        """Return True if a tracker that does not see its target should jump from its own place to
        another one: there the confidence of this frame alone is above 0.75, and its logit is more
        than 0.5 above that of the own place.

        Args:
            other: Signs at the other place.
            own: Signs at the tracker's place.
        """
        least = max(math.log(REGAINED / (1 - REGAINED)), self.logit(own) + AHEAD)
        return self.logit(other) > least

    def judge(self, signs: Signs, time: float, *, anew: bool = False) -> float:
        """Set `status` and `trusted` for a frame, and return the confidence 0..1, smoothed over
        0.15 s.

        The status is LOCKED from a confidence of 0.5 on (0.75 after a frame that was not LOCKED),
        LOST below 0.1, else UNSURE. `trusted` is True if this frame alone gives a confidence above
        0.5.

        Args:
            signs: Signs at the tracker's place.
            time: Time of the frame [s].
            anew: Begin the smoothing again with this frame: the tracker has jumped to another
                place.
        """
        logit = self.logit(signs)
        self.trusted = logit > 0
        usual = self._usual or signs
        if self.trusted:
            usual = Signs(
                usual.answer + LEARNED * (signs.answer - usual.answer),
                usual.first + LEARNED * (signs.first - usual.first),
                signs.distance,
            )
        self._usual = usual
        # First-order low pass for frames at any times; the first frame is taken as it is.
        keep = 0.0 if anew else math.exp(-max(time - self._time, 0.0) / MEMORY)
        self._logit = keep * self._logit + (1 - keep) * logit
        self._time = time
        confidence = 1 / (1 + math.exp(-self._logit))
        if confidence >= (HELD if self.status is Status.LOCKED else REGAINED):
            self.status = Status.LOCKED
            self._unseen_since = None
        else:
            if self._unseen_since is None:
                self._unseen_since = time
            self.status = Status.LOST if confidence < GONE else Status.UNSURE
        return confidence
