"""The camera stays where it is. The baseline, and the way to test a tracker by itself."""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import Task
from servo.types import Command, Mode, Sight
from sim.types import Posture


@dataclass(frozen=True, slots=True)
class Config:
    """No settings."""

    def build(self, rng: np.random.Generator) -> "Hold":
        """Return the controller, which uses no random numbers."""
        return Hold()


@final
class Hold:
    """Asks for no motion, whatever is seen."""

    def start(self, task: Task) -> None:
        """Begin a task."""

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Ask for no motion."""
        return Command(np.zeros(6), mode=Mode.HOLDING)
