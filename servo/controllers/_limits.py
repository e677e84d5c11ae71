"""Limits of a law's twist: of speed and acceleration, and those of a guard."""

from dataclasses import dataclass
from math import hypot
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

from servo.parts import Task
from servo.types import Sight
from sim.types import Array, Posture


@dataclass(frozen=True, slots=True)
class DesiredTwist:
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
class LimitedTwist:
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

    def limited(self, desired: DesiredTwist) -> LimitedTwist:
        """Return the twist instead of the one that is desired."""
        ...


@final
class Limits:
    """Shortens twists, and changes of twists, as a whole, so that they keep their direction."""

    def __init__(
        self,
        speed: float,
        turn: float,
        acceleration: float | None,
        acceleration_turn: float | None,
    ) -> None:
        """Begin at rest, with limits in m/s, rad/s, m/s^2 and rad/s^2; None: there is none."""
        self._speed = speed
        self._turn = turn
        self._most_change = None
        if acceleration is not None or acceleration_turn is not None:
            self._most_change = (acceleration or np.inf, acceleration_turn or np.inf)
        self._last = np.zeros(6)

    def apply(self, twist: Array, dt: float) -> tuple[Array, bool]:
        """Return the twist (6,) that is allowed now, and whether it differs from the one asked for.

        Args:
            twist: Camera twist (6,) [m/s, rad/s].
            dt: Time since the last one [s].
        """
        allowed = twist / max(1.0, excess(twist, self._speed, self._turn))
        if self._most_change is not None:
            change = allowed - self._last
            excessive = excess(change, *(dt * most for most in self._most_change))
            if excessive > 1.0:
                allowed = self._last + change / excessive
        self._last = allowed
        return allowed, bool((allowed != twist).any())


def excess(twist: Array, speed: float, turn: float) -> float:
    """Return how many times as fast as allowed a twist (6,) is, in m/s or in rad/s."""
    vx, vy, vz, wx, wy, wz = twist.tolist()
    return max(hypot(vx, vy, vz) / speed, hypot(wx, wy, wz) / turn)
