"""Image-based visual servoing with the target's motion fed forward.

After Teuliere, Marchand, Eck, equation 17, with L# the weighted pseudo-inverse and z a secondary
task:

    v = -lambda L# e - L# de/dt + (I - L# L) z

The paper prints both lines of its law without lambda. All six degrees of freedom with the
minimum-norm pseudo-inverse tilt the camera while every error is small, so the default moves only
vx, vy, vz and wz.

A joint at the end of its range leaves the solution: the law goes on with what the others can do,
and where that is not all features, with the first of them.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.controllers._inverse import Inverse, servoed_by, twist_of
from servo.controllers._law_settings import LawSettings, adaptive_gain
from servo.controllers._limits import DesiredTwist, Guard, LimitedTwist, Limits, excess
from servo.controllers._pending_commands import PendingCommands
from servo.controllers._range_ends import RangeEnds
from servo.controllers._target_loss import TargetLoss
from servo.mistake import unknown
from servo.parts import FeatureSet, OwnInverse, Task
from servo.types import DOF, Command, Mode, OwnMotion, Prediction, Sight, Trace
from sim.types import Array, Posture

FORESEEN = 3.0
"""Frames for which the matrix is taken to go on changing as it did; chosen by hand."""
PRESETS = {"paper": {"gain": 1.0, "dof": DOF, "feed_forward": ("xn", "yn", "an", "theta")}}
"""The law as Teuliere, Marchand and Eck print it."""


@dataclass(frozen=True, slots=True)
class Config(LawSettings):
    """The control law."""

    def build(self, rng: np.random.Generator) -> "Ibvs":
        """Return the controller, which uses no random numbers."""
        return Ibvs(self)


def _fed_forward(config: LawSettings, features: FeatureSet) -> Array:
    """Return 1 for the features (k,) whose target motion is compensated, 0 for the others.

    Raises:
        ValueError: There is no such feature.
    """
    names = features.names
    chosen = features.feed_forward if config.feed_forward is None else config.feed_forward
    missing = next((name for name in chosen if name not in names), None)
    if missing is not None and chosen == PRESETS["paper"]["feed_forward"]:
        raise ValueError(
            f'controller.feed_forward: {", ".join(chosen)} (as in preset = "paper") are '
            f"features of 'moments'; there is {', '.join(names)}"
        )
    if missing is not None:
        raise ValueError(f"controller.feed_forward: {unknown(missing, names, 'feature')}")
    return np.array([float(name in chosen) for name in names])


@final
class Ibvs:
    """The law, and what it must remember between frames."""

    def __init__(self, config: LawSettings, guard: Guard | None = None) -> None:
        """Build it; a guard may change each twist that follows what is seen."""
        self._config = config
        self._guard = guard
        self._weights = np.array(config.weights)

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: feed_forward names a feature that the set does not have.
        """
        c = self._config
        self._features = task.features
        self._own_inverse = task.features if isinstance(task.features, OwnInverse) else None
        self._camera = task.camera
        self._estimator = task.estimator
        self._fed = _fed_forward(c, self._features)
        if self._guard is not None:
            self._guard.start(task)
        self._aim(task.goal)
        self._scales = self._features.scales(self._goal)
        self._known = self._features.known(task.goal)
        self._tilt_seen = False
        self._seen = self._goal
        self._matrix_seen = self._goal_matrix
        self._loss = TargetLoss(c.coast, c.search_after, c.search_speed)
        self._limits = Limits(c.fastest, c.fastest_turn, c.acceleration, c.acceleration_turn)
        self._pending = PendingCommands(task.latency)
        self._before: Array | None = None
        self._change: Array | None = None
        self._first = np.zeros(6)
        self._faded_features = np.zeros(len(self._scales), bool)
        self._time = 0.0
        self._servoed: NDArray[np.bool_] | None = None
        self._ends: RangeEnds | None = None

    def _aim(self, goal: Sight) -> None:
        """Take over another goal."""
        self._aimed_at = goal
        self._goal = self._features.values(goal)
        self._goal_matrix = self._features.matrix(goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the twist for what is seen now; where it is not seen, that of the estimated
        motion, then none, or that of a search.
        """
        self._see(seen)
        error = self._features.error(self._seen, self._goal)
        scales = self._scales
        own = self._own(posture, dt)
        if seen is not None:
            measured = np.where(self._known, error / scales, np.nan)
            predicted = self._estimator.update(measured, own, dt)
            mode = self._loss.seen()
        else:
            predicted = self._estimator.skip(own, dt)
            mode = self._loss.wait(dt)
        predicted = predicted.times(scales)
        asked = self._twist(predicted, mode, posture, dt, seen)
        ends = self._ends
        joints = () if ends is None else ends.bounds.names_at(ends.held)
        limits = tuple(dict.fromkeys((*joints, *asked.limits)))
        twist, saturated = self._limits.apply(asked.twist, dt)
        self._pending.add(twist)
        return Command(
            twist,
            saturated or bool(limits),
            mode,
            Trace(
                self._seen,
                error,
                predicted,
                scales,
                own.past,
                self._servoed,
                None if ends is None else ends.held,
            ),
            limits,
            asked.violated,
        )

    def _see(self, seen: Sight | None) -> None:
        """Take over what is seen; `_change` is that of the matrix since the last frame, None unless
        the same features were known in both.
        """
        if seen is None:
            self._before = None
            self._change = None
            return
        if seen.goal is not None and seen.goal is not self._aimed_at:
            self._aim(seen.goal)
        known_before = self._known
        self._known = self._features.known(seen)
        self._tilt_seen = seen.tilt_known
        self._seen = self._features.values(seen)
        self._matrix_seen = self._features.matrix(seen)
        before = self._before
        self._before = self._matrix_seen
        self._change = None
        same = bool((known_before == self._known).all())
        if before is not None and same and self._config.interval == "mean":
            self._change = self._matrix_seen - before

    def _own(self, posture: Posture, dt: float) -> OwnMotion:
        """Return what the camera does to the features, over their scales. The matrix is taken in
        the middle of each interval, where its change is known: going on as it did for those to
        come.
        """
        L = self._matrix_seen / self._scales[:, None]
        change = 0.0 * L if self._change is None else self._change / self._scales[:, None]
        coming = list[Array]()
        begins = 0.0
        pieces = self._pending.coming(posture, dt)
        for twist, share in pieces:
            coming.append((L + min(begins + share / 2, FORESEEN) * change) @ twist)
            begins += share
        past = (L - 0.5 * change) @ posture.twist
        held = dt * np.array([share for _, share in pieces])
        return OwnMotion(past, np.array(coming).reshape(-1, len(past)), held)

    def _twist(
        self, predicted: Prediction, mode: Mode, posture: Posture, dt: float, seen: Sight | None
    ) -> LimitedTwist:
        """Return the twist of the law before limits of speed; a guard has limited it. `_ends` are
        then those of the joints that it left out.
        """
        self._ends = None
        if mode is Mode.HOLDING:
            return LimitedTwist(np.zeros(6))
        if mode is Mode.SEARCHING:
            return LimitedTwist(self._loss.search(dt))
        c = self._config
        pieces = self._pending.coming(posture, dt)
        way = sum((twist * share for twist, share in pieces), start=np.zeros(6)) * dt
        inverse, made = self._left_by_ranges(predicted, posture, way, dt)
        twist, asked, target = self._asked(inverse, predicted, made)
        if c.smooth_start > 0:
            twist = twist + self._faded(asked, dt, seen)
        if c.secondary:
            twist = twist + c.secondary_gain * inverse.free @ twist_of(c.secondary, posture)
        if self._guard is None:
            return LimitedTwist(twist)
        L = (inverse.L / self._scales[:, None])[self._known]
        moves = inverse.moves & (self._weights > 0)
        return self._guard.limited(DesiredTwist(twist, target, L, moves, way, seen, posture, dt))

    def _asked(
        self, inverse: Inverse, predicted: Prediction, made: Array | None
    ) -> tuple[Array, Array, Array]:
        """Return the twist (6,) of the law, and its two parts with the other sign: for the error,
        and for the target's own motion.

        Args:
            inverse: Of what may move.
            predicted: What the twist answers.
            made: What joints at the ends of their ranges still make (6,); the others answer that,
                too.
        """
        ahead = inverse.pseudo @ predicted.error
        asked = adaptive_gain(self._config, ahead) * ahead
        target = inverse.pseudo @ (self._fed * predicted.motion)
        twist = -asked - target
        if made is not None:
            twist += made - inverse.pseudo @ (inverse.L @ made)
        return twist, asked, target

    def _left_by_ranges(
        self, predicted: Prediction, posture: Posture, way: Array, dt: float
    ) -> tuple[Inverse, Array | None]:
        """Return the inverse over what joints inside their ranges can do, and the twist (6,) that
        the others still make; None where there are no others.

        Args:
            predicted: What the twist shall answer.
            posture: The robot.
            way: What the camera still moves (6,) before the twist acts [m, rad].
            dt: Time since the last frame [s].
        """
        inverse = self._inverse(posture)
        made: Array | None = None
        ends = RangeEnds.of(posture, way, dt)
        moves = inverse.moves
        may_move = moves & (self._weights > 0)
        while ends is not None:
            twist, _, _ = self._asked(inverse, predicted, made)
            fast = max(1.0, excess(twist, self._config.fastest, self._config.fastest_turn))
            more = ends.holding(twist / fast)
            left = None if more is ends else more.left(may_move)
            if left is None:
                break
            self._ends = ends = more
            motions, made = left
            rows = servoed_by(self._goal_matrix, motions)
            # Both of the centre: in the order alone, the first took a direction from the second.
            rows[:2] = True
            rows &= self._known
            # A guard weighs only the features that are servoed still.
            L = self._chosen_matrix() * rows[:, None]
            inverse = replace(Inverse.through_joints(L, rows, motions), moves=moves)
        return inverse, made

    def _faded(self, asked: Array, dt: float, seen: Sight | None) -> Array:
        """Return the part of a twist (6,) that a smooth start takes away. It begins again where
        more features are known than before, as when the tracker first reports angle and size.
        """
        if seen is not None and (self._known & ~self._faded_features).any():
            self._first = asked
            self._faded_features |= self._known
            self._time = 0.0
        faded = self._first * np.exp(-self._config.smooth_start * self._time)
        self._time += dt
        return faded

    def _inverse(self, posture: Posture) -> Inverse:
        """Return the inverse over the known features and the degrees of freedom that may move. With
        fewer than six joints these decide what may move.
        """
        if 0 < posture.jacobian.shape[1] < len(DOF):  # none: a robot that takes any twist
            rows = self._known & self._servoed_by(posture)
            return Inverse.through_joints(self._chosen_matrix(), rows, posture.jacobian)
        if self._own_inverse is not None and self._known.all():
            L = self._chosen_matrix()
            pseudo = self._own_inverse.inverse(L, self._seen, self._camera)
            return Inverse(pseudo, L, np.ones(len(DOF), bool))
        moves = self._config.moves_for(self._features, self._known, tilt_seen=self._tilt_seen)
        return Inverse.of(self._chosen_matrix(), self._known, moves, self._weights)

    def _servoed_by(self, posture: Posture) -> NDArray[np.bool_]:
        """Return the features (k,) that the robot's joints can servo, as found in the beginning."""
        if self._servoed is None:
            self._servoed = servoed_by(self._goal_matrix, posture.jacobian)
        return self._servoed

    def _chosen_matrix(self) -> Array:
        match self._config.matrix:
            case "current":
                return self._matrix_seen
            case "desired":
                return self._goal_matrix
            case "mean":
                return (self._matrix_seen + self._goal_matrix) / 2
