"""A law without a model: the interaction matrix is learned from how the features follow the camera.

Hosoda and Asada 1994 (Versatile visual servoing without knowledge of true Jacobian, IROS), after
Broyden 1965: with ds the change of the features (k,) and dx the camera's motion (6,) between two
pictures,

    L <- L + (ds - L dx) dx' / (rho + dx' dx),    v = -lambda L+ e

It knows neither the lens nor the target nor any depth; that the robot makes the twist that it is
asked for, it takes from the robot. It begins with a small motion in each direction.
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
"""Motion between two pictures [m, rad] of which half is believed: it moves a corner by about a
pixel, so less of it is the corners' noise."""
WEAK = 0.005
"""Directions that move the features by less than this share of the strongest are left out: what
was learned of them is noise. A shift against a tilt moves a small target's corners by 0.008."""
BACK = 0.01
"""Share of a frame interval: a camera that is nearer than this to where it began is back."""


@dataclass(frozen=True, slots=True)
class Config:
    """The law, and how it explores."""

    gain: Gain = 1.0
    """lambda [1/s]."""
    probe: Annotated[float, Gt(0), Le(1)] = 0.06
    """Speed of the first motions [m/s, rad/s]."""
    probe_time: Annotated[float, Gt(0), Le(10)] = 0.4
    """Time of each of them, forth and back [s]."""
    fastest: Limit = 0.6
    """Largest speed of the camera [m/s]."""
    fastest_turn: Limit = 2.0
    """Largest angular speed of the camera [rad/s]."""

    def build(self, rng: np.random.Generator) -> "Broyden":
        """Return the controller, which uses no random numbers."""
        return Broyden(self)


@final
class Broyden:
    """The law, and the matrix that it has learned so far."""

    def __init__(self, config: Config) -> None:
        """Take the settings."""
        self._config = config

    def start(self, task: Task) -> None:
        """Begin a task: nothing is known."""
        c = self._config
        self._features = task.features
        self._goal = task.goal
        self._limits = Limits(c.fastest, c.fastest_turn, None, None)
        self._matrix = np.zeros((len(self._features.names), len(DOF)))
        self._before: Array | None = None
        self._direction = 0
        """The one that is probed."""
        self._pace = 0.0
        """What the last command makes of the probe's speed: 1 forth, -1 back."""
        self._away = 0.0
        """How far the camera is from where the probe began, over the probe's speed [s]."""
        self._returns = False

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the twist for what is seen now; where it is not seen, none."""
        self._away += self._pace * dt
        self._pace = 0.0
        if seen is None or not self._features.known(seen).all():
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
        surprise = change - self._matrix @ motion
        self._matrix += np.outer(surprise, motion) / (SEEN**2 + motion @ motion)

    def _probe(self, dt: float) -> Array | None:
        """Return a twist that moves in one direction, forth and then back to where it began; None
        once it has been through all.

        It moves for whole frame intervals, at least for one, and goes by the time that they took.
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
