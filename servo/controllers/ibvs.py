"""Image-based visual servoing with the target's motion fed forward.

After Teuliere, Marchand, Eck, equation 17:

    v = -lambda L+ e - L+ de/dt

The paper prints both lines of its law without lambda. All six degrees of freedom with the
minimum-norm pseudo-inverse tilt the camera while every error looks fine, so the default moves only
vx, vy, vz and wz.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Gt

from servo import features
from servo.estimators.difference import Difference
from servo.interaction import interaction
from servo.types import DOF, FEATURES, Command, Sight, Task
from sim.types import Array

Dof = Literal["vx", "vy", "vz", "wx", "wy", "wz"]
Feature = Literal["xn", "yn", "an", "theta"]
RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero in the pseudo-inverse."""


@dataclass(frozen=True, slots=True)
class Config:
    """The control law."""

    gain: Annotated[float, Gt(0)] = 2.0
    """lambda [1/s]; with one frame of delay and period T the loop is unstable from lambda T = 1 on.
    """
    dof: tuple[Dof, ...] = ("vx", "vy", "vz", "wz")
    """Parts of the camera twist that may move."""
    feed_forward: tuple[Feature, ...] = ("xn", "yn")
    """Features whose target motion is compensated; those that do not move only add noise."""
    matrix: Literal["current", "desired", "mean"] = "current"
    """Where the interaction matrix is taken: at s, at s*, or the mean of both."""
    coast: Annotated[float, Ge(0)] = 1.0
    """How long the estimated motion is still followed while the target is not seen [s]; then hold.
    """
    fastest: Annotated[float, Gt(0)] = 0.6
    """Largest speed of the camera [m/s]."""
    fastest_turn: Annotated[float, Gt(0)] = 2.0
    """Largest angular speed of the camera [rad/s]."""

    def build(self, rng: np.random.Generator) -> Ibvs:
        """The controller; draws nothing."""
        return Ibvs(self)


@final
class Ibvs:
    """The law, and what it must remember between frames."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._moves = np.array([name in config.dof for name in DOF])
        self._fed = np.array([float(name in config.feed_forward) for name in FEATURES])

    def start(self, task: Task) -> None:
        """Begin a task."""
        self._task = task
        self._goal = features.of_moments(task.goal.moments, task.scale)
        self._goal_matrix = self._matrix(task.goal)
        self._measured = Difference()
        self._known = task.goal.known
        self._seen, self._matrix_seen, self._unseen = self._goal, self._goal_matrix, 0.0

    def command(self, seen: Sight | None, twist_measured: Array, dt: float) -> Command:
        """The twist for what is seen now; without a sight, the target's motion alone, and in the
        end nothing.
        """
        estimator = self._task.estimator
        if seen is not None:
            self._unseen = 0.0
            self._known = seen.known
            self._seen, self._matrix_seen = (
                features.of_moments(seen.moments, self._task.scale),
                self._matrix(seen),
            )
            error = features.error_of(self._seen, self._goal)
            own = self._matrix_seen @ twist_measured
            measurable = self._measured.ready
            difference = self._measured.update(error, own, dt)
            measured = difference if measurable else np.full(4, np.nan)
            moving = estimator.update(error, own, dt)
            wanted = -self._config.gain * error - self._fed * moving
        else:
            self._unseen += dt
            error = features.error_of(self._seen, self._goal)
            self._measured.skip()
            measured, moving = np.full(4, np.nan), estimator.skip()
            wanted = -self._fed * moving * (self._unseen <= self._config.coast)
        twist, saturated = self._limited(self._inverse() @ wanted)
        return Command(
            twist=twist,
            features=self._seen,
            error=error,
            target_motion=moving,
            target_motion_measured=measured,
            saturated=saturated,
        )

    def _matrix(self, sight: Sight) -> Array:
        return interaction(sight.moments, sight.plane, self._task.scale)

    def _inverse(self) -> Array:
        """L+ (6, 4) over the known features and the degrees of freedom that may move.

        A feature that is not known takes the degree of freedom that is its own with it: the depth
        or the turn of the camera then holds.
        """
        choices = {
            "current": self._matrix_seen,
            "desired": self._goal_matrix,
            "mean": (self._matrix_seen + self._goal_matrix) / 2,
        }
        rows, moves = np.array(self._known), self._moves.copy()
        moves[DOF.index("vz")] &= rows[FEATURES.index("an")]
        moves[DOF.index("wz")] &= rows[FEATURES.index("theta")]
        L = choices[self._config.matrix][np.ix_(rows, moves)]
        inverse = np.zeros((6, 4))
        inverse[np.ix_(moves, rows)] = np.linalg.pinv(L, rcond=RANK_TOLERANCE)
        return inverse

    def _limited(self, twist: Array) -> tuple[Array, bool]:
        """The twist at most as fast as allowed, in the same direction, and whether it was
        shortened.
        """
        speed, turn = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
        excess = float(max(speed / self._config.fastest, turn / self._config.fastest_turn))
        return (twist / excess, True) if excess > 1 else (twist, False)
