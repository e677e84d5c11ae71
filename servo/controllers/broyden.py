"""Controller without a model: it learns the interaction matrix from how the features follow the
camera.

Hosoda and Asada 1994 (Versatile visual servoing without knowledge of true Jacobian, IROS), after
Broyden 1965: with ds the change of the features (k,) and dx the camera's motion (6,) between two
pictures,

    L <- L + (ds - L dx) dx' / (rho + dx' dx),    v = -lambda L+ e

It needs no model of the lens, the target or its depth, only the measured twist of the camera. It
begins with a small motion along each of the six components of the twist, forth and back.
"""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Gt, Le

from servo.controllers._law_settings import Gain, Limit
from servo.controllers._limits import Limits
from servo.parts import Task
from servo.types import DOF, Command, Mode, Sight
from sim.types import Array, Posture

SEEN = 1e-3
"""Square root of rho: motion between two pictures [m, rad] at which half of the correction is
applied. It moves a corner by about a pixel; smaller changes are mostly noise."""
WEAK = 0.005
"""Directions that move the features by less than this share of the strongest one are left out:
their learned rows are noise. A shift against a tilt moves a small target's corners by 0.008."""
BACK = 0.01
"""Distance from the start of a probe at which the camera is back [frame intervals of motion]."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the controller `broyden`: its gain [1/s], speed [m/s, rad/s] and time [s] of the
    first motions by which it learns, and the camera's largest speeds [m/s, rad/s].
    """

    gain: Gain = 1.0
    """Gain lambda [1/s]."""
    probe: Annotated[float, Gt(0), Le(1)] = 0.06
    """Speed of the first motions [m/s, rad/s]."""
    probe_time: Annotated[float, Gt(0), Le(10)] = 0.4
    """Time of each first motion, forth and back [s]."""
    fastest: Limit = 0.6
    """Largest speed of the camera [m/s]."""
    fastest_turn: Limit = 2.0
    """Largest angular speed of the camera [rad/s]."""

    def build(self, rng: np.random.Generator) -> "Broyden":
        """Return the controller, which uses no random numbers."""
        return Broyden(self)


@final
class Broyden:
    """Controller that learns the interaction matrix L from the changes of the features (Broyden's
    update). It first moves the camera a little forth and back along each of the six components of
    the twist, and then commands v = -lambda L+ e, with the feature error e and the pseudo-inverse
    L+.
    """

    def __init__(self, config: Config) -> None:
        """Store the settings."""
        self._config = config

    def start(self, task: Task) -> None:
        """Begin a run with the features and the goal of a task: the learned interaction matrix is
        zero, and the first motions, forward and back along each component of the twist, are still
        to do.
        """
        c = self._config
        self._features = task.features
        self._goal = task.goal
        self._limits = Limits(c.fastest, c.fastest_turn, None, None)
        self._matrix = np.zeros((len(self._features.names), len(DOF)))
        self._before: Array | None = None
        self._direction = 0
        """Index of the direction that is probed."""
        self._pace = 0.0
        """Speed of the last command over the probe's speed: 1 forth, -1 back."""
        self._away = 0.0
        """Distance of the camera from the start of the probe, over the probe's speed [s]."""
        self._returns = False

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the command after a picture: first the small motions by which the interaction
        matrix is learned, then v = -lambda L+ e. The twist is zero, with `Mode.HOLDING`, if the
        target is not seen or a feature is not measured.

        Args:
            seen: The target as it is seen; None if it is not.
            posture: Measured state of the robot; only the camera twist is used.
            dt: Time since the last picture [s].
        """
        self._away += self._pace * dt
        self._pace = 0.0
        if seen is None or not self._features.known(seen).all():
            # A change over a gap would mix several motions: learn from the next pair of pictures.
            self._before = None
            return Command(np.zeros(6), mode=Mode.HOLDING)
        values = self._features.values(seen)
        if self._before is not None:
            self._learn(self._features.error(values, self._before), posture.twist * dt)
        self._before = values
        twist = self._probe(dt)
        if twist is None:
            error = self._features.error(values, self._features.values(seen.goal or self._goal))
            twist = -self._config.gain * np.linalg.pinv(self._matrix, rcond=WEAK) @ error
        twist, saturated = self._limits.apply(twist, dt)
        return Command(twist, saturated)

    def _learn(self, change: Array, motion: Array) -> None:
        # Broyden's update, with rho = SEEN^2 against noise of small motions.
        surprise = change - self._matrix @ motion
        self._matrix += np.outer(surprise, motion) / (SEEN**2 + motion @ motion)

    def _probe(self, dt: float) -> Array | None:
        """Return the next camera twist (6,) [m/s, rad/s] of the first motions, forth and back along
        each of six directions; None when all are done.

        Each way lasts at least one frame interval; the camera's way back is computed from the
        measured times.
        """
        if self._returns and abs(self._away) < BACK * dt:
            self._direction += 1
            self._away = 0.0
            self._returns = False
        if self._direction == len(DOF):
            return None
        forth = max(dt, self._config.probe_time / 2)
        self._returns |= self._away > forth - dt / 2
        self._pace = float(np.clip(-self._away / dt, -1.0, 1.0)) if self._returns else 1.0
        return self._pace * self._config.probe * np.eye(len(DOF))[self._direction]
