"""The camera stays where it is. The baseline, and the way to test a tracker by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.controllers.ibvs import Config as IbvsConfig
from servo.controllers.ibvs import Ibvs
from servo.types import Command, Sight, Task
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, rng: np.random.Generator) -> Hold:
        """The controller; draws nothing."""
        return Hold()


@final
class Hold:
    """Measures and estimates as IBVS does, and asks for no motion."""

    def __init__(self) -> None:
        self._eyes = Ibvs(IbvsConfig())

    def start(self, task: Task) -> None:
        """Begin a task."""
        self._eyes.start(task)

    def command(self, seen: Sight | None, twist_measured: Array, dt: float) -> Command:
        """No motion."""
        asked = self._eyes.command(seen, twist_measured, dt)
        return Command(
            twist=np.zeros(6),
            features=asked.features,
            error=asked.error,
            target_motion=asked.target_motion,
            target_motion_measured=asked.target_motion_measured,
            saturated=False,
        )
