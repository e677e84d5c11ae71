"""What stands between the law's twist and the command: values, and the protocol of a guard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from servo.parts import Task
from servo.types import Sight
from sim.types import Array, Posture


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the law asks for, and what it knows."""

    twist: Array
    """Camera twist (6,) of the law, before any limit [m/s, rad/s]."""
    target: Array
    """The target's own motion, as the twist (6,) of a camera that sees a still target move so."""
    L: Array
    """Interaction matrix (k, 6) of the features that are known, over their scales."""
    moves: NDArray[np.bool_]
    """Degrees of freedom (6,) that may move."""
    way: Array
    """What the camera still moves (6,) before this command acts [m, rad]."""
    seen: Sight | None
    """The target; None where it is not seen."""
    posture: Posture
    """What the robot knows of itself."""
    dt: float
    """Time since the last frame [s]."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """A twist, and which limits changed it."""

    twist: Array
    """Camera twist (6,) [m/s, rad/s]."""
    limits: tuple[str, ...] = ()
    """Names of the limits that changed it."""
    violated: tuple[str, ...] = ()
    """Those that it does not keep."""


class Guard(Protocol):
    """Changes the law's twist where it would break a limit."""

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: A setting does not fit the task.
        """
        ...

    def allowed(self, wanted: Wanted) -> Allowed:
        """The twist instead of the one that is wanted."""
        ...
