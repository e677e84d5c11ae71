"""Tracker that does not look at the pictures: it reports the first state, moved by the camera's
motion if that is given (setting `run.ego`). It is the baseline of all trackers.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from sim.types import Array, Frame
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    Trait,
    check_region,
    unknown_covariance,
)


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `frozen` has no settings."""

    traits = frozenset[Trait]()

    def build(self, rng: np.random.Generator) -> "Frozen":
        """Return a new tracker; `rng` is not used."""
        return Frozen()


@final
class Frozen:
    """Tracker that reports the first state in every frame, moved by the camera's motion if that is
    given, with the status UNSURE.
    """

    _state: State = SET_BY_START

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Store the target's state in the first frame, which `update` reports; the picture is not
        used.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        check_region(frame, region, state)
        self._state = state

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return an estimate with the last state, plus the change `ego` (4,) of x, y [px], theta
        [rad] and ln scale that the camera's motion causes, if it is given. The status is always
        UNSURE, the distance 1, and the covariance nan; `frame` is not used.
        """
        self._state = self._state.moved(ego)
        return Estimate(
            self._state, unknown_covariance(), 1.0, Status.UNSURE, follows=(False, False)
        )
