"""Tracker by the histograms of multiple kernels, without random numbers: Newton's descent from the
predicted state.

Hager, Dewan, Stewart 2004; Teuliere, Marchand, Eck, section III.
"""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame
from tracking.appearance.bins import as_seen
from tracking.loss import LossJudge, LossLimits
from tracking.search.newton import KernelGrid, KernelModel, shows_angle
from tracking.search.velocity import Velocity
from tracking.settings import Inset, Levels
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

STEPS = 12
"""Most histogram evaluations of one descent: starts up to 15 px away need 6 to 10."""
PRESETS = {"paper": {"span": 1.0, "inset": 0.0, "velocity_memory": 1.0}}


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the tracker `mk_ssd`: colour bins of each channel, correction of uneven light,
    half axis of the kernels in cells (`span`), share of the region's width and height that they
    leave out (`inset`), and share of the old velocity in the new one.
    """

    levels: Levels = 8
    """Colour bins a channel."""
    even: bool = False
    """Divide each pixel by its largest channel, as if all pixels were lit alike."""
    span: Annotated[float, Ge(0.5), Le(10)] = 1.5
    """Half axis of an Epanechnikov kernel, in cells; 1.5 has the widest basin."""
    inset: Inset = 0.03
    """Share of the region's width and height that the kernels leave out, half on each side: there
    the background shows, whose change would be taken for the target's."""
    velocity_memory: Share = 0.5
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""
    traits = frozenset({Trait.COLOUR, Trait.ANGLE})

    def build(self, rng: np.random.Generator) -> "MkSsd":
        """Return a new tracker with these settings; `rng` is not used."""
        return MkSsd(self)


@final
class MkSsd:
    """Tracker that finds the target by one Newton descent on histograms from the predicted state in
    each frame. A target that was not seen is expected at its last state, moved by the camera's
    motion if that is given.
    """

    _velocity: Velocity = SET_BY_START

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histograms under nine kernels from the first frame, in which it is the
        rectangle `region` [px] at `state`. If turning the target hardly changes them, its angle is
        not followed.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        check_region(frame, region, state)
        c = self._config
        grid = KernelGrid(span=c.span, levels=c.levels, inset=c.inset)
        image = as_seen(frame.image, even=c.even)
        self._turns = shows_angle(image, region, state)
        self._kernels = KernelModel(image, region, state, grid, turns=self._turns)
        self._state = state
        self._loss = LossJudge(LossLimits())
        self._velocity = Velocity(state, c.velocity_memory)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate for the next frame: the end of Newton's descent from the predicted
        state or, where the target is not seen there, the last state moved by `ego`.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.
        """
        # Called in every frame, because the velocity takes in the camera's motion here.
        expected = self._velocity.step(ego)
        # A hidden target is expected where it was seen last, moved by the camera alone.
        begin = self._state.moved(expected if self._loss.locked else ego)
        image = as_seen(frame.image, even=self._config.even)
        descent = self._kernels.descend(image, begin, most=STEPS)
        status = self._loss.judge(descent.distance, frame.time)
        seen = status is Status.LOCKED
        self._state = descent.state if seen else self._state.moved(ego)
        self._velocity.learn(self._state, seen=seen)
        return Estimate(
            self._state,
            self._kernels.covariance(image, self._state) if seen else unknown_covariance(),
            descent.distance,
            status,
            follows=(self._turns, True),
            evaluations=descent.evaluations,
        )
