"""Controller that keeps the camera at rest: a baseline, and a test of the tracker alone."""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import Task
from servo.types import Command, Mode, Sight
from sim.types import Posture


@dataclass(frozen=True, slots=True)
class Config:
    """The controller `hold` has no settings."""

    def build(self, rng: np.random.Generator) -> "Hold":
        """Return the controller, which uses no random numbers."""
        return Hold()


@final
class Hold:
    """Controller that commands a camera twist of zero after each picture."""

    def start(self, task: Task) -> None:
        """Begin a run; the task is not used, and nothing is stored."""

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return a command with a camera twist of zero and `Mode.HOLDING`; the arguments are not
        used.
        """
        return Command(np.zeros(6), mode=Mode.HOLDING)
