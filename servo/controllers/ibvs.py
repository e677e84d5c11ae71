"""Image-based visual servoing with the target's motion fed forward.

After Teuliere, Marchand, Eck, equation 17, with L# the weighted pseudo-inverse and z a secondary
task:

    v = -lambda L# e - L# de/dt + (I - L# L) z

The paper prints both lines of its law without lambda. All six degrees of freedom with the
minimum-norm pseudo-inverse tilt the camera while every error looks fine, so the default moves only
vx, vy, vz and wz.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Le

from servo import features
from servo.controllers._absence import Absence
from servo.controllers._inverse import Inverse
from servo.controllers._limits import Limits
from servo.controllers._secondary import Secondary, twist_of
from servo.estimators.difference import Difference
from servo.interaction import interaction
from servo.types import DOF, FEATURES, Command, Mode, Outlook, OwnMotion, Sight, Task
from sim.ranges import Time
from sim.types import Array, Posture

Dof = Literal["vx", "vy", "vz", "wx", "wy", "wz"]
Feature = Literal["xn", "yn", "an", "theta"]
Weight = Annotated[float, Ge(0), Le(1e6)]
Gain = Annotated[float, Ge(1e-6), Le(1000)]
Limit = Annotated[float, Ge(1e-6), Le(100)]
LimitOfChange = Annotated[float, Ge(1e-3), Le(1e6)]


@dataclass(frozen=True, slots=True)
class Config:
    """The control law."""

    gain: Gain = 2.0
    """lambda [1/s], at the goal; with one frame of delay and period T the loop is unstable from
    lambda T = 1 on.
    """
    gain_far: Gain | None = None
    """lambda far from the goal [1/s], for a gain that adapts; by default it is the same."""
    gain_slope: Annotated[float, Ge(0), Le(1e6)] = 30.0
    """How fast lambda falls from the goal outwards: -d lambda / d |L# e| there."""
    smooth_start: Annotated[float, Ge(0), Le(1000)] = 0.0
    """mu [1/s]: the first velocity is taken away at first, and fades in as 1 - exp(-mu t); 0: the
    camera starts at once.
    """
    dof: tuple[Dof, ...] = ("vx", "vy", "vz", "wz")
    """Parts of the camera twist that may move."""
    weights: tuple[Weight, Weight, Weight, Weight, Weight, Weight] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """How readily each part of the twist moves, where several could; 0.1 on wx and wy keeps a
    camera with all six almost level."""
    secondary: tuple[Secondary, ...] = ()
    """What the motions that change no feature are used for: "level" (optical axis straight down),
    "avoid_limits" (of the joints), "centre" (joints to the middles of their ranges)."""
    secondary_gain: Gain = 1.0
    """Gain of the secondary tasks [1/s]."""
    feed_forward: tuple[Feature, ...] = ("xn", "yn")
    """Features whose target motion is compensated; those that do not move only add noise."""
    matrix: Literal["current", "desired", "mean"] = "current"
    """Where the interaction matrix is taken: at s, at s*, or the mean of both."""
    coast: Time = 1.0
    """How long the estimated motion is still followed while the target is not seen [s]; then hold.
    """
    search_after: Time | None = None
    """How long the camera holds before it searches the target on a spiral [s]; by default it never
    does.
    """
    search_speed: Limit = 0.1
    """Speed of the camera while it searches [m/s]."""
    fastest: Limit = 0.6
    """Largest speed of the camera [m/s]."""
    fastest_turn: Limit = 2.0
    """Largest angular speed of the camera [rad/s]."""
    acceleration: LimitOfChange | None = None
    """Largest acceleration of the camera [m/s^2]; by default the drives' own."""
    acceleration_turn: LimitOfChange | None = None
    """Largest angular acceleration of the camera [rad/s^2]; by default the drives' own."""

    def __post_init__(self) -> None:
        for name in ("dof", "secondary", "feed_forward"):
            given = getattr(self, name)
            twice = next((item for i, item in enumerate(given) if item in given[:i]), None)
            if twice is not None:
                raise ValueError(f"{name} has '{twice}' twice")
        if not any(weight for name, weight in zip(DOF, self.weights, strict=True)
                   if name in self.dof):  # fmt: skip
            raise ValueError(
                "dof and weights let no part of the twist move; for a camera that stands still "
                'set controller.kind = "hold"'
            )

    def build(self, rng: np.random.Generator) -> Ibvs:
        """The controller; draws nothing."""
        return Ibvs(self)


def adaptive_gain(config: Config, ahead: Array) -> float:
    """lambda(x) = (l0 - linf) exp(-l0' x / (l0 - linf)) + linf, as in ViSP.

    Args:
        config: l0 is its gain, linf its gain_far, l0' its gain_slope.
        ahead: L# e (6,); x is its largest part.
    """
    if config.gain_far is None or config.gain_far == config.gain:
        return config.gain
    x, span = float(np.abs(ahead).max()), config.gain - config.gain_far
    return span * float(np.exp(-config.gain_slope * x / abs(span))) + config.gain_far


@final
class Ibvs:
    """The law, and what it must remember between frames."""

    def __init__(self, config: Config) -> None:
        self._config = c = config
        self._moves = np.array([name in c.dof for name in DOF])
        self._fed = np.array([float(name in c.feed_forward) for name in FEATURES])
        self._weights = np.array(c.weights)

    def start(self, task: Task) -> None:
        """Begin a task."""
        c, self._task = self._config, task
        self.aim(task.goal)
        an = self._goal[FEATURES.index("an")]
        self._unit = np.array([an, an, an, 1.0])
        self._measured = Difference()
        self._known = np.array(task.goal.known)
        self._seen, self._matrix_seen = self._goal, self._goal_matrix
        self._absence = Absence(c.coast, c.search_after, c.search_speed)
        self._limits = Limits(c.fastest, c.fastest_turn, c.acceleration, c.acceleration_turn)
        self._coming = deque([np.zeros(6)] * task.latency, maxlen=task.latency)
        self._first: Array | None = None
        self._time = 0.0

    def aim(self, goal: Sight) -> None:
        """Go on with another goal."""
        self._goal = features.of_moments(goal.moments, self._task.scale)
        self._goal_matrix = self._matrix(goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """The twist for what is seen now; without a sight, what the estimate says, and in the end
        nothing, or a search.
        """
        if seen is not None:
            self._look(seen)
        error = features.error_of(self._seen, self._goal)
        relative, L = error / self._unit, self._matrix_seen / self._unit[:, None]
        coming = np.array([L @ twist for twist in self._coming]).reshape(-1, 4)
        own = OwnMotion(L @ posture.twist, coming)
        if seen is not None:
            ready = self._measured.ready
            difference = self._unit * self._measured.measure(relative, own.past, dt)
            measured = difference if ready else np.full(4, np.nan)
            outlook = self._task.estimator.update(relative, own, dt)
            mode = self._absence.seen()
        else:
            self._measured.forget()
            measured = np.full(4, np.nan)
            outlook, mode = self._task.estimator.skip(own, dt), self._absence.wait(dt)
        outlook = outlook.times(self._unit)
        twist, saturated = self._limits.apply(self._twist(outlook, mode, posture, dt), dt)
        self._coming.append(twist)
        return Command(twist, self._seen, error, outlook, measured, saturated, mode)

    def _look(self, seen: Sight) -> None:
        self._known = np.array(seen.known)
        self._seen = features.of_moments(seen.moments, self._task.scale)
        self._matrix_seen = self._matrix(seen)

    def _matrix(self, sight: Sight) -> Array:
        return interaction(sight.moments, sight.plane, self._task.scale)

    def _twist(self, outlook: Outlook, mode: Mode, posture: Posture, dt: float) -> Array:
        """What the law asks for, before any limit."""
        if mode is Mode.HOLDING:
            return np.zeros(6)
        if mode is Mode.SEARCHING:
            return self._absence.search(dt)
        c, inverse = self._config, self._inverse()
        ahead = inverse.pseudo @ outlook.error
        gain = adaptive_gain(c, ahead)
        twist = -gain * ahead - inverse.pseudo @ (self._fed * outlook.motion)
        if c.smooth_start > 0:
            self._first = gain * ahead if self._first is None else self._first
            twist = twist + self._first * np.exp(-c.smooth_start * self._time)
            self._time += dt
        if c.secondary:
            twist = twist + c.secondary_gain * inverse.free @ twist_of(c.secondary, posture)
        return twist

    def _inverse(self) -> Inverse:
        """Over the known features and the degrees of freedom that may move.

        A feature that is not known takes the degree of freedom that is its own with it: the depth
        or the turn of the camera then holds.
        """
        moves = self._moves
        if not self._known.all():
            moves = moves.copy()
            moves[DOF.index("vz")] &= self._known[FEATURES.index("an")]
            moves[DOF.index("wz")] &= self._known[FEATURES.index("theta")]
        return Inverse.of(self._chosen_matrix(), self._known, moves, self._weights)

    def _chosen_matrix(self) -> Array:
        match self._config.matrix:
            case "current":
                return self._matrix_seen
            case "desired":
                return self._goal_matrix
            case "mean":
                return (self._matrix_seen + self._goal_matrix) / 2
