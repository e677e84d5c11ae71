"""Tracker: kernel mean shift on a colour histogram (Comaniciu, Ramesh, Meer 2003)."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame
from tracking.appearance.bins import LabelledImage
from tracking.appearance.layout import Kernel, Sampling
from tracking.appearance.model import AppearanceSettings, SampledModel
from tracking.loss import LossJudge
from tracking.search.velocity import Velocity
from tracking.settings import PLAIN
from tracking.trackers._cloud import DISC_LIMITS
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    check_region,
    unknown_covariance,
)

SCALE_STEP = 0.1
"""With scale, sizes 10 % smaller and larger are tried too (Comaniciu, Ramesh, Meer)."""
SCALE_TRUST = 0.1
"""Share of the way to the best size that the next one goes (the same paper): the Bhattacharyya
coefficient prefers small sizes."""
NEIGHBOURS = np.exp(1j * np.arange(8) * np.pi / 4)
"""Directions of the eight places around the target."""
PRESETS = {"paper": PLAIN | {"tolerance": 1.0}}


@dataclass(frozen=True, slots=True)
class Climb:
    """Choices in which trackers by mean shift differ: the largest number of histograms read in one
    search (climb), `steps`; whether the size is followed, `scale`; and the confidence 1 - d, 0..1,
    with d the distance from the target's histogram, below which eight more searches begin around
    the target.
    """

    steps: int = 20
    """Most histograms read in one climb; with fewer, a long climb ends before the mode."""
    scale: bool = False
    """Also follow the target's size."""
    confidence: float = 0.0
    """Confidence 1 - d below which eight more climbs begin around the target; 0: never."""


@dataclass(frozen=True)
class ClimbSettings(AppearanceSettings):
    """Settings of a tracker that climbs by mean shift: its histograms, the shift [px] below which a
    climb ends, and the share of the old velocity, 0..1, that the new one keeps (with 1 the velocity
    stays zero).
    """

    tolerance: Annotated[float, Ge(0.001), Le(1000)] = 0.2
    """A shorter shift ends the climb [px]."""
    velocity_memory: Share = 1.0
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""

    @property
    @abstractmethod
    def climb(self) -> Climb:
        """Choices of this tracker: most histograms read in one search by mean shift (climb),
        whether the size is followed, and the confidence, 0..1, below which eight more climbs begin
        around the target.
        """

    @property
    def idle(self) -> Mapping[str, str]:
        """The reason why `contrast` has no effect, where the size is not followed."""
        why = "this tracker does not follow the size, so the surroundings are not compared"
        return {} if self.climb.scale else {"contrast": why}

    def build(self, rng: np.random.Generator) -> "MeanShift":
        """Return a new mean-shift tracker with these settings; `rng` is not used."""
        return MeanShift(self)


@dataclass(frozen=True, slots=True)
class Config(ClimbSettings):
    """Settings of the tracker `mean_shift`: those of the colour histogram and of the climb, the
    kernel, and whether the target's size is followed.
    """

    kernel: Kernel = "epanechnikov"
    """1 - r^2, or "linear": 1 - r, as the KAMS paper has it."""
    scale: bool = False
    """Also follow the target's size, by trying 10 % more and less."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(kernel=self.kernel)

    @property
    def climb(self) -> Climb:
        return Climb(scale=self.scale)


@final
class MeanShift:
    """Tracker that in each frame moves from the predicted state to a local maximum of the
    similarity to the target's histogram by mean shift (a climb). The search leaves the angle and,
    unless `settings.climb.scale` is True, the size as they are: only the camera's motion changes
    them, where it is given.
    """

    _model: SampledModel = SET_BY_START

    def __init__(self, settings: ClimbSettings) -> None:
        self._settings = settings
        self._climb = settings.climb

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histogram from the first frame, in which it is the rectangle `region`
        [px] at `state`.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        check_region(frame, region, state)
        self._model = self._settings.model(frame.image, region, state)
        self._size = float(np.sqrt(region.area(state)))
        self._unit = self._size / state.scale
        self._state = state
        self._loss = LossJudge(DISC_LIMITS)
        self._velocity = Velocity(state, self._settings.velocity_memory)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate for the next frame: the best end of a search by mean shift (climb)
        from the predicted state and, if its confidence is below `Climb.confidence`, of eight more
        from places around that state.

        If the size is followed, climbs also begin at sizes 10 % smaller and larger, and the
        estimate's size goes a tenth of the way, in ln scale, from the predicted size to that of the
        best end.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.
        """
        image = self._model.label(frame.image)
        begin = self._state.vector + self._velocity.step(ego)
        found, distances, evaluations = self._climbed(image, self._sizes(begin))
        # The structured octal kernel (`sok`) begins eight more climbs when it is unsure.
        if 1 - distances.min() < self._climb.confidence:
            more, others, work = self._climbed(image, self._around(begin))
            found = np.vstack([found, more])
            distances = np.append(distances, others)
            evaluations += work
        # Distances alone prefer small sizes; the energy adds the ring's likeness (`contrast`).
        index = np.argmin(self._model.energy(image, found) if self._climb.scale else distances)
        best = found[index]
        distance = float(distances[index])
        # The size is smoothed as in Comaniciu, Ramesh, Meer (2003), whose gamma is 0.1.
        best[3] = begin[3] + SCALE_TRUST * (best[3] - begin[3])
        self._state = State.of(best)
        status = self._loss.judge(distance, frame.time)
        self._velocity.learn(self._state, seen=status is Status.LOCKED)
        if status is Status.LOCKED:
            self._model.learn(image, self._state)
        return Estimate(
            self._state,
            unknown_covariance(),
            distance,
            status,
            follows=(False, self._climb.scale),
            evaluations=evaluations,
        )

    def _climbed(self, image: LabelledImage, states: Array) -> tuple[Array, Array, int]:
        tolerance = self._settings.tolerance
        return self._model.climb(
            image, states, most=self._climb.steps, tolerance=tolerance, reach=2 * self._size
        )

    def _sizes(self, begin: Array) -> Array:
        """Return the states (n, 4) from which climbs begin: the expected one (4,) and, where the
        size is followed, a smaller and a larger one.
        """
        steps = np.log1p([0.0, -SCALE_STEP, SCALE_STEP]) if self._climb.scale else np.zeros(1)
        return begin + steps[:, None] * [0, 0, 0, 1]

    def _around(self, begin: Array) -> Array:
        """Return eight states (8, 4) on a ring around the expected one (4,), at twice the target's
        radius: together they cover nine times its area.
        """
        ring = self._unit * np.exp(begin[3]) * NEIGHBOURS
        return begin + np.column_stack([ring.real, ring.imag, np.zeros((8, 2))])
