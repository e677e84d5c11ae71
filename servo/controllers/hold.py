"""The camera stays where it is. The baseline, and the way to test a tracker by itself."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import final

import numpy as np

from servo.controllers.ibvs import Config as IbvsConfig
from servo.controllers.ibvs import Ibvs
from servo.types import Command, Mode, Sight, Task
from sim.types import Posture


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
        # Nothing that was asked for is on its way.
        self._eyes.start(dataclasses.replace(task, latency=0))

    def aim(self, goal: Sight) -> None:
        """Go on with another goal."""
        self._eyes.aim(goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """No motion."""
        asked = self._eyes.command(seen, posture, dt)
        return dataclasses.replace(asked, twist=np.zeros(6), saturated=False, mode=Mode.HOLDING)
