"""Image-based visual servoing with the target's motion fed forward.

After Teuliere, Marchand, Eck, equation 17, with L# the weighted pseudo-inverse and z a secondary
task:

    v = -lambda L# e - L# de/dt + (I - L# L) z

The paper prints both lines of its law without lambda. All six degrees of freedom with the
minimum-norm pseudo-inverse tilt the camera while every error is small, so the default moves only
vx, vy, vz and wz.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from servo.controllers._guard import Allowed, Guard, Wanted
from servo.controllers._inverse import Inverse
from servo.controllers._limits import Limits
from servo.controllers._secondary import Secondary, twist_of
from servo.controllers._target_loss import TargetLoss
from servo.mistake import unknown
from servo.parts import FeatureSet, Task
from servo.types import DOF, Command, Mode, OwnMotion, Prediction, Sight, Trace
from sim.ranges import Time
from sim.types import Array, Posture

Dof = Literal["vx", "vy", "vz", "wx", "wy", "wz"]
UNTILTED = ("vx", "vy", "vz", "wz")
"""Degrees of freedom that leave the camera's axis as it is."""
PRESETS = {"paper": {"gain": 1.0, "dof": list(DOF), "feed_forward": ["xn", "yn", "an", "theta"]}}
"""The law as Teuliere, Marchand and Eck print it."""
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
    dof: tuple[Dof, ...] | None = None
    """Parts of the camera twist that may move; by default all six where there are six features or
    more and the tilt of the target's plane is seen, else vx, vy, vz, wz."""
    weights: tuple[Weight, Weight, Weight, Weight, Weight, Weight] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """How readily each part of the twist moves, where several could; 0.1 on wx and wy keeps a
    camera with all six almost level."""
    secondary: tuple[Secondary, ...] = ()
    """What the motions that change no feature are used for: "level" (optical axis straight down),
    "avoid_limits" (of the joints), "centre" (joints to the middles of their ranges)."""
    secondary_gain: Gain = 1.0
    """Gain of the secondary tasks [1/s]."""
    feed_forward: tuple[str, ...] | None = None
    """Features whose target motion is compensated; those that do not move only add noise. By
    default those that the feature set names: xn and yn of "moments"."""
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
            given = getattr(self, name) or ()
            twice = next((item for i, item in enumerate(given) if item in given[:i]), None)
            if twice is not None:
                raise ValueError(f"{name} has '{twice}' twice")
        if not any(weight for name, weight in zip(DOF, self.weights, strict=True)
                   if name in _chosen(self.dof)):  # fmt: skip
            raise ValueError(
                "dof and weights let no part of the twist move; for a camera that stands still "
                'set controller.kind = "hold"'
            )

    def build(self, rng: np.random.Generator) -> Ibvs:
        """The controller; draws nothing."""
        return Ibvs(self)


def _chosen(dof: tuple[Dof, ...] | None, default: tuple[str, ...] = UNTILTED) -> tuple[str, ...]:
    return default if dof is None else dof


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


def _fed_forward(config: Config, features: FeatureSet) -> Array:
    """1 for the features (k,) whose target motion is compensated, 0 for the others."""
    names, chosen = features.names, config.feed_forward
    for name in chosen or ():
        if name not in names:
            raise ValueError(f"controller.feed_forward: {unknown(name, names, 'feature')}")
    fed = features.feed_forward if chosen is None else chosen
    return np.array([float(name in fed) for name in names])


@final
class Ibvs:
    """The law, and what it must remember between frames."""

    def __init__(self, config: Config, guard: Guard | None = None) -> None:
        """Build it; a guard may change each twist that follows what is seen."""
        self._config, self._guard = (c := config), guard
        self._tilt_seen = False
        self._weights = np.array(c.weights)

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: feed_forward names a feature that the set does not have.
        """
        c, self._features, self._estimator = self._config, task.features, task.estimator
        self._fed = _fed_forward(c, self._features)
        if self._guard is not None:
            self._guard.start(task)
        self.aim(task.goal)
        self._scales = self._features.scales(self._goal)
        self._known = self._features.known(task.goal)
        self._seen, self._matrix_seen = self._goal, self._goal_matrix
        self._loss = TargetLoss(c.coast, c.search_after, c.search_speed)
        self._limits = Limits(c.fastest, c.fastest_turn, c.acceleration, c.acceleration_turn)
        self._coming = deque([np.zeros(6)] * task.latency, maxlen=task.latency)
        self._first: Array | None = None
        self._time = 0.0

    def aim(self, goal: Sight) -> None:
        """Go on with another goal."""
        self._goal, self._goal_matrix = self._features.values(goal), self._features.matrix(goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """The twist for what is seen now; where it is not seen, the estimated motion, then
        none, or a search.
        """
        if seen is not None:
            self._known, self._tilt_seen = self._features.known(seen), seen.tilt_known
            self._seen, self._matrix_seen = self._features.values(seen), self._features.matrix(seen)
        error, scales = self._features.error(self._seen, self._goal), self._scales
        relative, L = error / scales, self._matrix_seen / scales[:, None]
        coming = np.array([L @ twist for twist in self._coming]).reshape(-1, len(error))
        own = OwnMotion(L @ posture.twist, coming)
        if seen is not None:
            predicted, mode = self._estimator.update(relative, own, dt), self._loss.seen()
        else:
            predicted, mode = self._estimator.skip(own, dt), self._loss.wait(dt)
        predicted = predicted.times(scales)
        asked = self._twist(predicted, mode, posture, dt, seen)
        twist, saturated = self._limits.apply(asked.twist, dt)
        self._coming.append(twist)
        return Command(
            twist, saturated or bool(asked.limits), mode,
            Trace(self._seen, error, predicted, scales, own.past), asked.limits, asked.violated,
        )  # fmt: skip

    def _twist(
        self, predicted: Prediction, mode: Mode, posture: Posture, dt: float, seen: Sight | None
    ) -> Allowed:
        """The twist that the law asks for, before limits of speed; a guard has approved it."""
        if mode is Mode.HOLDING:
            return Allowed(np.zeros(6))
        if mode is Mode.SEARCHING:
            return Allowed(self._loss.search(dt))
        c, inverse = self._config, self._inverse()
        ahead = inverse.pseudo @ predicted.error
        gain = adaptive_gain(c, ahead)
        target = inverse.pseudo @ (self._fed * predicted.motion)
        twist = -gain * ahead - target
        if c.smooth_start > 0:
            self._first = gain * ahead if self._first is None else self._first
            twist = twist + self._first * np.exp(-c.smooth_start * self._time)
            self._time += dt
        if c.secondary:
            twist = twist + c.secondary_gain * inverse.free @ twist_of(c.secondary, posture)
        if self._guard is None:
            return Allowed(twist)
        L = (inverse.L / self._scales[:, None])[self._known]
        way = sum(self._coming, start=np.zeros(6)) * dt
        moves = inverse.moves & (self._weights > 0)
        return self._guard.allowed(Wanted(twist, target, L, moves, way, seen, posture, dt))

    def _inverse(self) -> Inverse:
        """Over the known features and the degrees of freedom that may move: while the depth or the
        angle is not known, the part of the twist that it alone controls is zero.
        """
        moves = self._moves()
        if not self._known.all():
            for name, dof in self._features.sole_dof.items():
                moves[DOF.index(dof)] &= self._known[self._features.names.index(name)]
        return Inverse.of(self._chosen_matrix(), self._known, moves, self._weights)

    def _moves(self) -> NDArray[np.bool_]:
        """The degrees of freedom (6,) that may move."""
        six = self._tilt_seen and len(self._known) >= len(DOF)
        chosen = _chosen(self._config.dof, DOF if six else UNTILTED)
        return np.array([name in chosen for name in DOF])

    def _chosen_matrix(self) -> Array:
        match self._config.matrix:
            case "current":
                return self._matrix_seen
            case "desired":
                return self._goal_matrix
            case "mean":
                return (self._matrix_seen + self._goal_matrix) / 2
