"""Multiple kernels, deterministic: Newton's descent from the last state.

Hager, Dewan, Stewart 2004; Teuliere, Marchand, Eck, section III.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Frame
from tracking.lock import Lock, LockConfig
from tracking.search.newton import KernelModel
from tracking.search.velocity import Velocity
from tracking.settings import Colours, Inset
from tracking.types import Estimate, Region, State, Status, check_region, unknown_covariance

PRESETS = {"paper": {"span": 1.0, "inset": 0.0, "velocity_memory": 1.0}}


@dataclass(frozen=True, slots=True)
class Config(Colours):
    """Kernels and descent."""

    cells: Annotated[int, Ge(1), Le(8)] = 3
    """Kernels along each side: 3 is the paper's nine."""
    span: Annotated[float, Ge(0.5), Le(10)] = 1.5
    """Half axis of an Epanechnikov kernel, in cells; 1.5 has the widest basin."""
    inset: Inset = 0.03
    steps: Annotated[int, Ge(1), Le(100)] = 12
    """Most histogram evaluations of one descent."""
    velocity_memory: Share = 0.5
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""
    lock: LockConfig = field(default_factory=LockConfig)
    """When the target counts as hidden or lost."""

    def build(self, rng: np.random.Generator) -> MkSsd:
        """The tracker; draws nothing."""
        return MkSsd(self)


@final
class MkSsd:
    """One descent a frame; a hidden target is waited for where it was seen last."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histograms."""
        check_region(frame, region, state)
        c = self._config
        self._kernels = KernelModel(
            c.view(frame.image),
            region,
            state,
            per_side=c.cells,
            span=c.span,
            levels=c.levels,
            inset=c.inset,
        )
        self._state = state
        self._lock = Lock(c.lock)
        self._velocity = Velocity(state, c.velocity_memory)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Predict, descend, and stay if the descent ended on something else."""
        expected = self._velocity.step(ego)
        begin = self._state.moved(expected if self._lock.locked else ego)
        image = self._config.view(frame.image)
        ended = self._kernels.refine(image, begin, most=self._config.steps)
        status = self._lock.judge(ended.distance, frame.time)
        self._state = ended.state if status is Status.LOCKED else self._state.moved(ego)
        self._velocity.learn(self._state, seen=status is Status.LOCKED)
        return Estimate(
            self._state,
            unknown_covariance(),
            ended.distance,
            status,
            evaluations=ended.evaluations,
        )
