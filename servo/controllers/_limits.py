"""Limits of a control law's twist: largest speed and acceleration, and `Guard`, the protocol of
further limits, such as those of joints and view.
"""

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
    """The camera twist that a control law desires, before any limit, with the state of robot and
    target from which a guard computes its limits.
    """

    twist: Array
    """Camera twist (6,) of the law, before any limit [m/s, rad/s]."""
    target: Array
    """Camera twist (6,) that would change the features of a target at rest as the target's own
    motion now does, for the features that are fed forward [m/s, rad/s]."""
    L: Array
    """Interaction matrix (k, 6) of the features that are known, over their scales."""
    moves: NDArray[np.bool_]
    """Degrees of freedom (6,) that may move."""
    way: Array
    """Displacement (6,) of the camera before this command acts [m, rad]."""
    seen: Sight | None
    """The target; None if it is not seen."""
    posture: Posture
    """Joints, limits and Jacobian of the robot."""
    dt: float
    """Time since the last frame [s]."""


@dataclass(frozen=True, slots=True)
class LimitedTwist:
    """A camera twist after its limits: the names of the limits that changed it, and of those that
    it still violates.
    """

    twist: Array
    """Camera twist (6,) [m/s, rad/s]."""
    limits: tuple[str, ...] = ()
    """Names of the limits that changed it."""
    violated: tuple[str, ...] = ()
    """Names of the limits that the twist does not keep."""


class Guard(Protocol):
    """Protocol of an object that replaces each twist of a control law that would break a limit."""

    def start(self, task: Task) -> None:
        """Begin a run with a task, before the first call of `limited`.

        Raises:
            ValueError: A setting does not fit the task.
        """
        ...

    def limited(self, desired: DesiredTwist) -> LimitedTwist:
        """Return the twist to command in place of the desired one, with the names of the limits
        that changed it.
        """
        ...


@final
class Limits:
    """Limits of a twist's speed and acceleration. A twist beyond a speed limit is scaled down as a
    whole and keeps its direction; beyond an acceleration limit, its change since the last twist is
    scaled down.
    """

    def __init__(
        self,
        speed: float,
        turn: float,
        acceleration: float | None,
        acceleration_turn: float | None,
    ) -> None:
        """Create the limits; the last twist is zero, as of a camera at rest.

        Args:
            speed: Largest speed |v| [m/s].
            turn: Largest angular speed |w| [rad/s].
            acceleration: Largest acceleration [m/s^2]; None: unlimited.
            acceleration_turn: Largest angular acceleration [rad/s^2]; None: unlimited.
        """
        self._speed = speed
        self._turn = turn
        self._most_change = None
        if acceleration is not None or acceleration_turn is not None:
            self._most_change = (acceleration or np.inf, acceleration_turn or np.inf)
        self._last = np.zeros(6)

    def apply(self, twist: Array, dt: float) -> tuple[Array, bool]:
        """Return the twist (6,) within the limits, and True if it differs from the given one.

        Args:
            twist: Camera twist (6,) [m/s, rad/s].
            dt: Time since the last twist [s].
        """
        allowed = twist / max(1.0, excess(twist, self._speed, self._turn))
        if self._most_change is not None:
            # Shorten the change as a whole, so that it keeps its direction.
            change = allowed - self._last
            excessive = excess(change, *(dt * most for most in self._most_change))
            if excessive > 1.0:
                allowed = self._last + change / excessive
        self._last = allowed
        return allowed, bool((allowed != twist).any())


def excess(twist: Array, speed: float, turn: float) -> float:
    """Return the larger of two ratios: speed |v| of a twist (6,) over `speed`, and angular speed
    |w| over `turn`. Above 1 a limit is exceeded.
    """
    vx, vy, vz, wx, wy, wz = twist.tolist()
    return max(hypot(vx, vy, vz) / speed, hypot(wx, wy, wz) / turn)
