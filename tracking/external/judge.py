"""Is the target of another tracker still there? Our histogram, or the tracker's own score."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Literal

from sim.ranges import Share
from sim.types import Frame
from tracking.lock import Lock, LockConfig
from tracking.settings import DiscSettings
from tracking.types import Region, State, Status


@dataclass(frozen=True, slots=True)
class JudgeSettings:
    """What decides whether the target is seen."""

    judge: Literal["histogram", "score"] = "histogram"
    """Our colour histogram of the region that the tracker gives, or the tracker's own score."""
    least_score: Share = 0.3
    """With judge = "score": below this score the target is not seen."""
    follow_size: bool = True
    """Take over the size of the tracker's boxes too, once it has changed."""
    lock: LockConfig = field(default_factory=lambda: LockConfig(floor=0.5, cap=0.75))
    """When the target counts as hidden or lost; `least_score` replaces floor and cap."""


class Judge:
    """Gives the distance and the status of what another tracker found."""

    def __init__(self, settings: JudgeSettings, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histogram from the first frame, if that is to judge."""
        lock = settings.lock
        self._by_score = settings.judge == "score"
        if self._by_score:
            doubt = 1 - settings.least_score
            lock = dataclasses.replace(lock, floor=doubt, cap=doubt)
        else:
            self._model = DiscSettings().model(frame.image, region, state)
        self._lock = Lock(lock)

    def unseen(self, frame: Frame) -> tuple[float, Status]:
        """Distance and status of a target that the tracker itself does not find."""
        return 1.0, self._lock.judge(math.inf, frame.time)

    def seen(self, frame: Frame, state: State, score: float | None) -> tuple[float, Status]:
        """Distance and status at a state, with the tracker's score where it has one."""
        if self._by_score:
            distance = 1.0 - (score or 0.0)
            return distance, self._lock.judge(distance, frame.time)
        image = self._model.label(frame.image)
        distance = float(self._model.distances(image, state.vector[None])[0])
        status = self._lock.judge(distance, frame.time)
        if status is Status.LOCKED:
            self._model.learn(image, state)
        return distance, status
