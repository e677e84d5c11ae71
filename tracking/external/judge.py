"""Judgement of another tracker's target: by our histogram, or by the tracker's own score."""

import math
from dataclasses import dataclass
from typing import Literal

from sim.ranges import Share
from sim.types import Frame
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.lock import Lock, LockLimits
from tracking.settings import AppearanceSettings
from tracking.types import Region, State, Status

LOCK = LockLimits(floor=0.5, cap=0.75)
"""Limits of our histogram's distance: of hard bins, it is never near 0."""


@dataclass(frozen=True)
class JudgeSettings:
    """Settings of the judgement whether the target is seen."""

    judge: Literal["histogram", "score"] = "histogram"
    """Our colour histogram of the region that the tracker gives, or the tracker's own score."""
    least_score: Share = 0.3
    """With judge = "score": below this score the target is not seen."""
    follow_size: bool = True
    """Take over the size of the tracker's boxes too, once it has changed."""


class Judge:
    """Distance and status of what another tracker found."""

    def __init__(self, settings: JudgeSettings, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histogram from the first frame, if that is to judge."""
        lock = LOCK
        self._by_score = settings.judge == "score"
        if self._by_score:
            doubt = 1 - settings.least_score
            lock = LockLimits(floor=doubt, cap=doubt)
        else:
            histogram = AppearanceSettings()
            self._model = SampledModel(frame.image, region, state, histogram, Sampling())
        self._lock = Lock(lock)

    def unseen(self, frame: Frame) -> tuple[float, Status]:
        """Return distance and status of a target that the tracker itself does not find."""
        return 1.0, self._lock.judge(math.inf, frame.time)

    def seen(self, frame: Frame, state: State, score: float | None) -> tuple[float, Status]:
        """Return distance and status at a state, with the tracker's score where it has one."""
        if self._by_score:
            distance = 1.0 - (score or 0.0)
            return distance, self._lock.judge(distance, frame.time)
        image = self._model.label(frame.image)
        distance = float(self._model.distances(image, state.vector[None])[0])
        status = self._lock.judge(distance, frame.time)
        if status is Status.LOCKED:
            self._model.learn(image, state)
        return distance, status
