"""Kernel mean shift on a colour histogram (Comaniciu, Ramesh, Meer 2003)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame
from tracking.appearance.bins import Labelled
from tracking.lock import Lock
from tracking.search.velocity import Velocity
from tracking.settings import PLAIN, DiscSettings
from tracking.types import Estimate, Region, State, Status, check_region, unknown_covariance

SCALE_STEP = 0.1
"""With scale, sizes 10 % smaller and larger are tried too."""
SCALE_TRUST = 0.1
"""Share of the best size that the next one takes over: Bhattacharyya prefers to shrink."""
NEIGHBOURS = np.exp(1j * np.arange(8) * np.pi / 4)


PRESETS = {"paper": PLAIN | {"tolerance": 1.0}}


@dataclass(frozen=True, slots=True)
class Config(DiscSettings):
    """Histogram and climb."""

    steps: Annotated[int, Ge(1), Le(1000)] = 20
    """Most histograms read in one climb."""
    tolerance: Annotated[float, Ge(0.001), Le(1000)] = 0.2
    """A shorter shift ends the climb [px]."""
    velocity_memory: Share = 1.0
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""
    scale: bool = False
    """Also follow the target's size, by trying 10 % more and less."""
    confidence: Share = 0.0
    """Below this 1 - d, eight more climbs begin around the target (that is `sok`); 0: never."""

    def build(self, rng: np.random.Generator) -> MeanShift:
        """The tracker; draws nothing."""
        return MeanShift(self)


@final
class MeanShift:
    """One climb a frame, from where the target was."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram."""
        check_region(frame, region, state)
        c = self._config
        self._model = c.model(c.view(frame.image), region, state)
        self._size = float(np.sqrt(region.area(state)))
        self._state = state
        self._lock = Lock(c.lock)
        self._velocity = Velocity(state, c.velocity_memory)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Climb from where the target was, and from around it if that is far off; keep the best."""
        c = self._config
        image = self._model.label(c.view(frame.image))
        begin = self._state.vector + self._velocity.step(ego)
        found, distances, evaluations = self._climb(image, self._sizes(begin))
        if 1 - distances.min() < c.confidence:
            more, others, work = self._climb(image, self._around(begin))
            found = np.vstack([found, more])
            distances = np.append(distances, others)
            evaluations += work
        index = np.argmin(self._model.energy(image, found) if c.scale else distances)
        best = found[index]
        distance = float(distances[index])
        best[3] = begin[3] + SCALE_TRUST * (best[3] - begin[3])
        self._state = State.of(best)
        status = self._lock.judge(distance, frame.time)
        self._velocity.learn(self._state, seen=status is Status.LOCKED)
        if status is Status.LOCKED:
            self._model.learn(image, self._state)
        return Estimate(
            self._state,
            unknown_covariance(),
            distance,
            status,
            follows=(False, c.scale),
            evaluations=evaluations,
        )

    def _climb(self, image: Labelled, states: Array) -> tuple[Array, Array, int]:
        c = self._config
        return self._model.climb(
            image, states, most=c.steps, tolerance=c.tolerance, reach=2 * self._size
        )

    def _sizes(self, begin: Array) -> Array:
        """Where to begin (n, 4): as it is, and smaller and larger."""
        steps = np.log1p([0.0, -SCALE_STEP, SCALE_STEP]) if self._config.scale else np.zeros(1)
        return begin + steps[:, None] * [0, 0, 0, 1]

    def _around(self, begin: Array) -> Array:
        """Eight states (8, 4) on a ring at two radii: with the first they cover nine times its
        area.
        """
        ring = self._size * np.exp(begin[3]) * NEIGHBOURS
        return begin + np.column_stack([ring.real, ring.imag, np.zeros((8, 2))])
