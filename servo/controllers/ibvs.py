"""Controller of image-based visual servoing, with feed-forward of the target's motion.

The law is equation 17 of Teuliere, Marchand and Eck, with L# the weighted pseudo-inverse and z the
twist of secondary tasks:

    v = -lambda L# e - L# de/dt + (I - L# L) z

The paper prints both lines of its law without lambda. With all six degrees of freedom and four
features, the minimum-norm pseudo-inverse tilts the camera, however small the errors are; so with
fewer than six features only vx, vy, vz and wz move by default.

A joint at the end of its range is left out: the law goes on with the other joints. If these cannot
control all features, the law servos the first features of the set, as many as the joints can
control; a set of more than six features is servoed as a whole, by least squares.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.controllers._inverse import Inverse, servoed_by, takes_own_inverse, twist_of
from servo.controllers._law_settings import UNTILTED, LawSettings, adaptive_gain
from servo.controllers._limits import DesiredTwist, Guard, LimitedTwist, Limits, excess
from servo.controllers._pending_commands import PendingCommands
from servo.controllers._range_ends import RangeEnds
from servo.controllers._target_loss import TargetLoss
from servo.mistake import unknown
from servo.parts import FeatureSet, OwnInverse, Task
from servo.types import DOF, Command, Mode, OwnMotion, Prediction, Sight, Trace
from sim.types import Array, Posture

FORESEEN = 3.0
"""Largest number of frames over which the change of the interaction matrix is extrapolated; chosen
by hand."""
NO_TILT = (
    f"controller.weights: {', '.join(UNTILTED)} have the weight 0, and with fewer than six "
    "features only these move by default, so the camera would stand still: give one of them a "
    "weight above 0, or name wx or wy in controller.dof"
)
PRESETS = {"paper": {"gain": 1.0, "dof": DOF, "feed_forward": ("xn", "yn", "an", "theta")}}
"""The law as Teuliere, Marchand and Eck print it."""


@dataclass(frozen=True, slots=True)
class Config(LawSettings):
    """Settings of the controller `ibvs`, all of them from `LawSettings`: gains, degrees of freedom,
    secondary tasks, limits, and the camera's behaviour while the target is not seen.
    """

    def build(self, rng: np.random.Generator) -> "Ibvs":
        """Return the controller, which uses no random numbers."""
        return Ibvs(self)


def _fed_forward(config: LawSettings, features: FeatureSet) -> Array:
    """Return an array (k,) with 1 for each feature whose change by the target's own motion the law
    compensates, and 0 for the others.

    Raises:
        ValueError: `feed_forward` names a feature that is not in the set.
    """
    names = features.names
    chosen = features.feed_forward if config.feed_forward is None else config.feed_forward
    missing = next((name for name in chosen if name not in names), None)
    if missing is not None and chosen == PRESETS["paper"]["feed_forward"]:
        raise ValueError(
            f'controller.feed_forward: {", ".join(chosen)} (as in preset = "paper") are features '
            f'of features.kind = "moments"; name some of this kind: {", ".join(names)}'
        )
    if missing is not None:
        raise ValueError(f"controller.feed_forward: {unknown(missing, names, 'feature')}")
    return np.array([float(name in chosen) for name in names])


@dataclass(frozen=True, slots=True)
class _Measured:
    """The features of the target in a picture: values, interaction matrix, and which of them are
    measured.
    """

    values: Array
    """Features s (k,)."""
    matrix: Array
    """Interaction matrix (k, 6) at s."""
    known: NDArray[np.bool_]
    """True (k,) for each feature that the sight measures."""

    @staticmethod
    def of(features: FeatureSet, sight: Sight) -> "_Measured":
        """Return values, interaction matrix and measured flags of a feature set for the target in a
        picture.
        """
        return _Measured(features.values(sight), features.matrix(sight), features.known(sight))


@final
class Ibvs:
    """Controller that commands the camera twist v = -lambda L# e - L# de/dt + (I - L# L) z after
    each picture: e is the feature error, de/dt its rate by the target's own motion, L# the weighted
    pseudo-inverse of the interaction matrix L, and z the twist of secondary tasks. Joints that
    would leave their ranges are held, and the others compensate. `guard` limits the twist further,
    such as to keep the target in view; None: beyond that only speed and acceleration are limited.
    """

    def __init__(self, config: LawSettings, guard: Guard | None = None) -> None:
        """Store settings and guard.

        Args:
            config: Settings of the law.
            guard: Further limits of the twist while the camera follows the target, such as those of
                joints and view; None: only those of speed and acceleration.
        """
        self._config = config
        self._guard = guard
        self._weights = np.array(config.weights)

    def start(self, task: Task) -> None:
        """Begin a run with a task: the goal, features, estimator, camera and latency of the run.

        Raises:
            ValueError: The setting `feed_forward` names a feature that the set does not have, the
                weights of all components of the twist that may move with these features are 0, or
                the margin of the controller `qp` leaves nothing of the picture.
        """
        c = self._config
        self._features = task.features
        if not c.may_move(six=len(self._features.names) >= len(DOF)):
            raise ValueError(NO_TILT)
        self._own_inverse = task.features if isinstance(task.features, OwnInverse) else None
        self._camera = task.camera
        self._estimator = task.estimator
        self._fed = _fed_forward(c, self._features)
        if self._guard is not None:
            self._guard.start(task)
        self._aim(task.goal)
        self._scales = self._features.scales(self._goal.values)
        self._measured = self._goal
        self._tilt_seen = False
        self._loss = TargetLoss(c.coast, c.search_after, min(c.search_speed, c.fastest))
        self._limits = Limits(c.fastest, c.fastest_turn, c.acceleration, c.acceleration_turn)
        self._pending = PendingCommands(task.latency)
        self._was_seen = False
        self._change: Array | None = None
        self._first = np.zeros(6)
        self._faded_features = np.zeros(len(self._scales), bool)
        self._time = 0.0
        self._servoed: NDArray[np.bool_] | None = None
        self._ends: RangeEnds | None = None

    def _aim(self, goal: Sight) -> None:
        """Replace the desired features by those of another goal, for a goal that moves."""
        self._aimed_at = goal
        self._goal = _Measured.of(self._features, goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the command after a picture. While the target is not seen, the law goes on with
        the estimator's predictions for `coast` seconds, then the camera stands; after another
        `search_after` seconds, if that is set, it searches on a spiral, up to 0.6 m away.

        Args:
            seen: The target as it is seen, with the desired view as `goal`; None if it is not seen.
            posture: Camera pose, twist, joints, limits and Jacobian, as the robot knows them.
            dt: Time since the last picture that the tracker took [s].
        """
        self._see(seen)
        error = self._features.error(self._measured.values, self._goal.values)
        scales = self._scales
        pieces = self._pending.coming(posture, dt)
        own = self._own(pieces, posture, dt)
        if seen is not None:
            measured = np.where(self._measured.known, error / scales, np.nan)
            predicted = self._estimator.update(measured, own, dt)
            mode = self._loss.seen()
        else:
            predicted = self._estimator.skip(own, dt)
            mode = self._loss.wait(dt)
        predicted = predicted.times(scales)
        way = sum((twist * share for twist, share in pieces), start=np.zeros(6)) * dt
        asked = self._twist(predicted, mode, posture, way, dt, seen)
        ends = self._ends
        joints = () if ends is None else ends.bounds.names_at(ends.held)
        limits = tuple(dict.fromkeys((*joints, *asked.limits)))
        twist, saturated = self._limits.apply(asked.twist, dt)
        # What is stored is the limited twist: it is the one that will act.
        self._pending.add(twist)
        return Command(
            twist,
            saturated or bool(limits),
            mode,
            Trace(
                self._measured.values,
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
        """Store the features of the target in a picture; without a target keep the last ones.
        `_change` is then the change (k, 6) of the interaction matrix since the last picture, or
        None unless both pictures measure the same features and `interval` is "mean".
        """
        before = self._measured
        was_seen = self._was_seen
        self._was_seen = seen is not None
        self._change = None
        if seen is None:
            return
        if seen.goal is not None and seen.goal is not self._aimed_at:
            self._aim(seen.goal)
        self._measured = _Measured.of(self._features, seen)
        self._tilt_seen = seen.tilt_known
        same = bool((before.known == self._measured.known).all())
        if was_seen and same and self._config.interval == "mean":
            self._change = self._measured.matrix - before.matrix

    def _own(self, pieces: list[tuple[Array, float]], posture: Posture, dt: float) -> OwnMotion:
        """Return how the camera's motion changes the features, over their scales: since the last
        picture, and until the next command acts. If the change of the interaction matrix per frame
        is known, the matrix in the middle of each interval is used.
        """
        L = self._measured.matrix / self._scales[:, None]
        change = 0.0 * L if self._change is None else self._change / self._scales[:, None]
        coming = list[Array]()
        begins = 0.0
        for twist, share in pieces:
            coming.append((L + min(begins + share / 2, FORESEEN) * change) @ twist)
            begins += share
        past = (L - 0.5 * change) @ posture.twist
        held = dt * np.array([share for _, share in pieces])
        return OwnMotion(past, np.array(coming).reshape(-1, len(past)), held)

    def _twist(
        self,
        predicted: Prediction,
        mode: Mode,
        posture: Posture,
        way: Array,
        dt: float,
        seen: Sight | None,
    ) -> LimitedTwist:
        """Return the camera twist of the law for a mode, limited by the guard, but not yet in
        speed. `_ends` then has the joints that are held at the ends of their ranges, or None if no
        joint is held.

        Args:
            predicted: Error e, and de/dt of the target's own motion.
            mode: What the controller does.
            posture: Joints, limits and Jacobian of the robot.
            way: Displacement (6,) of the camera until the twist acts, which earlier commands cause
                [m, rad].
            dt: Time since the last picture [s].
            seen: The target in the picture; None if it is not seen.
        """
        self._ends = None
        if mode is Mode.HOLDING:
            return LimitedTwist(np.zeros(6))
        if mode is Mode.SEARCHING:
            return LimitedTwist(self._loss.search(dt))
        c = self._config
        inverse, made = self._left_by_ranges(predicted, posture, way, dt)
        twist, asked, target = self._asked(inverse, predicted, made)
        if c.smooth_start > 0:
            faded = self._faded(asked, dt, seen)
            if not inverse.is_own:  # only what moves the features that are still measured
                faded = inverse.pseudo @ (inverse.L @ faded)
            # Without an error, as while coasting, nothing has to begin smoothly.
            twist = twist + faded * asked.any()
        if c.secondary:
            twist = twist + c.secondary_gain * inverse.free @ twist_of(c.secondary, posture)
        if self._guard is None:
            return LimitedTwist(twist)
        L = (inverse.L / self._scales[:, None])[self._measured.known]
        moves = inverse.moves & (self._weights > 0)
        return self._guard.limited(DesiredTwist(twist, target, L, moves, way, seen, posture, dt))

    def _asked(
        self, inverse: Inverse, predicted: Prediction, made: Array | None
    ) -> tuple[Array, Array, Array]:
        """Return three camera twists (6,) [m/s, rad/s]: that of the law, -lambda L# e - L# de/dt
        with the compensation of `made`, and the two terms lambda L# e and L# de/dt alone, with a
        positive sign.

        Args:
            inverse: Inverse L# for the motions that are allowed.
            predicted: Error e, and de/dt of the target's own motion.
            made: Camera twist (6,) that the joints at the ends of their ranges make, which the
                other joints compensate; None: no joint is at an end.
        """
        # v = -lambda L# e - L# de/dt, the latter for the features that are fed forward.
        ahead = inverse.pseudo @ predicted.error
        asked = adaptive_gain(self._config, ahead) * ahead
        target = inverse.pseudo @ (self._fed * predicted.motion)
        twist = -asked - target
        if made is not None:
            # The free joints compensate what the held joints' motion changes in the features.
            twist += made - inverse.pseudo @ (inverse.L @ made)
        return twist, asked, target

    def _left_by_ranges(
        self, predicted: Prediction, posture: Posture, way: Array, dt: float
    ) -> tuple[Inverse, Array | None]:
        """Return the inverse L# for the joints that are inside their ranges, and the camera twist
        (6,) that the joints at the ends make; None for the twist if no joint is at an end.

        Args:
            predicted: Error e, and de/dt of the target's own motion.
            posture: Joints, limits and Jacobian of the robot.
            way: Displacement (6,) of the camera until the twist acts, which earlier commands cause
                [m, rad].
            dt: Time since the last picture [s].
        """
        inverse = self._inverse(posture)
        made: Array | None = None
        ends = RangeEnds.of(posture, way, dt)
        moves = inverse.moves
        may_move = moves & (self._weights > 0)
        # Without the joints held so far, others may be driven to their ends: repeat until none is.
        while ends is not None:
            twist, _, _ = self._asked(inverse, predicted, made)
            fast = max(1.0, excess(twist, self._config.fastest, self._config.fastest_turn))
            more = ends.holding(twist / fast)
            left = None if more is ends else more.left(may_move)
            if left is None:
                break
            self._ends = ends = more
            motions, made = left
            rows = servoed_by(self._goal.matrix, motions)
            # Keep both features of the centre: by the order alone, the first took the direction
            # that the second needs.
            rows[:2] = True
            rows &= self._measured.known
            # A guard weighs only the features that are still servoed.
            L = self._chosen_matrix() * rows[:, None]
            inverse = replace(Inverse.through_joints(L, rows, motions), moves=moves)
        return inverse, made

    def _faded(self, asked: Array, dt: float, seen: Sight | None) -> Array:
        """Return the twist (6,) that a smooth start adds to the law's: lambda L# e of the first
        picture times exp(-mu t), with t the time since then. It begins again when more features are
        measured than before, as when the tracker first reports angle and size.

        Args:
            asked: The term lambda L# e (6,) of this picture [m/s, rad/s].
            dt: Time since the last picture [s].
            seen: The target in the picture; None if it is not seen.
        """
        if seen is not None and (self._measured.known & ~self._faded_features).any():
            self._first = asked
            self._faded_features |= self._measured.known
            self._time = 0.0
        faded = self._first * np.exp(-self._config.smooth_start * self._time)
        self._time += dt
        return faded

    def _inverse(self, posture: Posture) -> Inverse:
        """Return the inverse L# for the features that are measured and the components of the twist
        that may move. For a robot with one to five joints it is J (L J)+; for a feature set with an
        inverse of its own it is that one while everything that it needs is measured.
        """
        if 0 < posture.jacobian.shape[1] < len(DOF):  # 0: a robot that takes any twist
            rows = self._measured.known & self._servoed_by(posture)
            return Inverse.through_joints(self._chosen_matrix(), rows, posture.jacobian)
        known = self._measured.known
        if self._own_inverse and takes_own_inverse(known, tilt_seen=self._tilt_seen):
            L = self._chosen_matrix()
            pseudo = self._own_inverse.inverse(L, self._measured.values, self._camera)
            return Inverse(pseudo, L, np.ones(len(DOF), bool), is_own=True)
        moves = self._config.moves_for(self._features, known, tilt_seen=self._tilt_seen)
        return Inverse.of(self._chosen_matrix(), known, moves, self._weights)

    def _servoed_by(self, posture: Posture) -> NDArray[np.bool_]:
        """Return True (k,) for each feature that the robot's joints can servo, computed at the goal
        with the first Jacobian of the run, and kept.
        """
        if self._servoed is None:
            self._servoed = servoed_by(self._goal.matrix, posture.jacobian)
        return self._servoed

    def _chosen_matrix(self) -> Array:
        match self._config.matrix:
            case "current":
                return self._measured.matrix
            case "desired":
                return self._goal.matrix
            case "mean":
                return (self._measured.matrix + self._goal.matrix) / 2
