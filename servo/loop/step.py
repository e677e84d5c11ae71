"""Data of one frame of a run: true poses, goal, picture, estimate, command, and the robot's motion
until the next frame.
"""

from dataclasses import dataclass, replace

import numpy as np
from mujoco import MjModel

from servo.parts import FeatureSet
from servo.sight.exact import sight_of
from servo.types import Command, Prediction, Sight
from sim.geometry import angle_of, tilt
from sim.types import Array, Camera, Frame, Pose, Posture, Truth
from tracking.types import Estimate, Region, State, Status

DOF = 6
HALF_TURN = Pose.planar(0.0, 0.0, np.pi)
TURNED = Pose.planar(0.0, 0.0, np.pi / 18)
NEARER = 1.1
"""A turn of the target at its goal about its normal, and a factor on its distance, which show
whether features tell its angle and its size."""
LEAST_CHANGE = 0.01
"""Least change of a feature by these that counts, over the feature's scale: a turn may also move
the centre of a tilted target a little."""
ROUNDING = 1e-6
"""Largest error of a feature that counts as rounding; a half turn of the target gives errors of the
size of the target."""


@dataclass(frozen=True, slots=True)
class Seconds:
    """Wall-clock times [s] that rendering, tracker, control law and physics took in one frame of a
    run.
    """

    render: float
    """Time spent waiting for this frame's picture and starting to render the next one [s]; most of
    the rendering goes on while the loop works."""
    track: float
    control: float
    physics: float

    @property
    def total(self) -> float:
        """Sum of the times of rendering, tracker, control law and physics [s]."""
        return self.render + self.track + self.control + self.physics


@dataclass(frozen=True, slots=True)
class Scene:
    """What stays the same in a run: camera, corners (4, 3) of the target's reference rectangle in
    its frame [m], the target's rectangle [px] and true size [px/m] in the first picture, feature
    set, pose of the reference rectangle in the target's frame, frame interval [s] and MuJoCo model.
    """

    camera: Camera
    outline: Array
    """Corners (4, 3) of the target's reference rectangle in its frame [m]."""
    region: Region
    """The target's rectangle in the first picture, as given to the tracker [px]."""
    first_size: float
    """The target's true size in the first frame [px/m]."""
    features: FeatureSet
    """Features that the law drives to their goal."""
    T_target_object: Pose
    """Pose of the reference rectangle's own frame in the target's (see `object_frame`)."""
    period: float
    """Frame interval [s]."""
    room: MjModel
    """MuJoCo model of the world, for drawing it."""

    def true_sight(self, T_world_camera: Pose, T_world_target: Pose, goal: Sight) -> Sight:
        """Return the exact view of the target from true poses: moments and corners in normalised
        image coordinates, and the plane and the pose T_camera_object of its reference rectangle in
        the camera frame (origin in the rectangle's centre, x along the target's nose, z along the
        normal, away from the camera).

        Args:
            T_world_camera: True pose of the camera in the world frame.
            T_world_target: True pose of the target in the world frame.
            goal: The desired view, which is stored in the result.
        """
        T_camera_target = T_world_camera.inverse() @ T_world_target
        return sight_of(T_camera_target @ self.T_target_object, self.outline, goal)

    def true_motion(
        self, T_world_camera: Pose, before: Pose, after: Pose, goal: Sight, dt: float
    ) -> Array:
        """Return the mean rate (k,), in the units of the k features per second, at which a target's
        motion between two poses changes the features for a camera at rest.

        Args:
            T_world_camera: True pose of the camera in the world frame.
            before: True pose of the target in the world frame at the beginning of the interval.
            after: True pose of the target in the world frame at the end of the interval.
            goal: The desired view of the target.
            dt: Length of the interval [s].
        """
        start, end = (
            self.features.values(self.true_sight(T_world_camera, target, goal))
            for target in (before, after)
        )
        return self.features.error(end, start) / dt


@dataclass(frozen=True, slots=True, repr=False)
class Step:
    """Data of one frame of a run: picture, true poses, goal, the latest estimate and command, and
    the robot's posture and its motion until the next frame.
    """

    scene: Scene
    frame: Frame
    truth: Truth
    target_before: Pose
    """T_world_target one frame interval ago; if the robot holds the target, as `World.target_at`
    defines it."""
    goal: Truth
    """The truth with the target at its goal, for the same pose of the camera."""
    goal_sight: Sight
    """The desired sight of the target, for the true camera."""
    estimate: Estimate
    """The tracker's latest estimate."""
    truth_estimated: Truth
    """The truth at the time of the frame `picture`, to which this estimate belongs."""
    picture: int
    """Number, from 0, of the frame whose picture gave this estimate, or of a later frame without a
    picture, for which the tracker's estimate was repeated."""
    decided: bool
    """Whether the law computed the command in the frame interval that begins with this frame; if
    not, command and estimate are those of the previous step."""
    age: float
    """Time from the frame `picture` until its estimate was ready [s]."""
    skipped: int
    """Number of pictures since the run began that the tracker skipped because it was busy."""
    command: Command
    """The law's latest command; if the caller of `Episode.move` replaced its twist, with that
    twist."""
    motion_measured: Array
    """de/dt (k,) of the target's own motion, in the features' units per second, measured between
    the last two pictures that the tracker took; nan for features that were not measured in both.
    """
    bodies: Array
    """Poses (n, 3, 4) in the world, [R | t] [m], of all bodies of the scene except the fixed world
    body, in the order of `World.moving`."""
    rates: Array
    """Joint velocities (n,) at the time of the frame [m/s or rad/s]."""
    twist_acting: Array
    """Commanded camera twist (6,) in the camera frame that acts until the next frame [m/s, rad/s];
    the mean, if the command changes in between.
    """
    posture: Posture
    """The robot's exact posture at the time of the frame; the law is given the believed one."""
    limited: bool
    """Whether a joint's range, speed or acceleration limit changes the motion until the next
    frame."""
    joint_limits: tuple[str, ...]
    """The joints at a limit, such as "elbow (range)", "elbow (speed)" or "elbow (acceleration)"."""
    seconds: Seconds

    def __repr__(self) -> str:
        return (
            f"Step(frame {self.frame.index}, {self.frame.time:.3f} s: servo error "
            f"{self.servo_error:.2f} px, tracking error {self.tracking_error:.2f} px, "
            f"{self.estimate.status.name}, {self.command.mode.name})"
        )

    def light(self) -> "Step":
        """Return a copy of this step that takes little memory: with a black picture of the same
        size, and without depth picture and the tracker's particles.
        """
        estimate = self.estimate
        if estimate.particles is not None:
            estimate = replace(estimate, particles=None)
        return replace(self, frame=self.frame.black(), estimate=estimate)

    @property
    def region(self) -> Region:
        """Width and height [px] of the target's rectangle in the first picture, as the tracker was
        given them.
        """
        return self.scene.region

    @property
    def true_state(self) -> State:
        """True centre x, y [px], angle, from right towards down [rad], and scale of the target in
        this frame; the scale in the first frame is 1.
        """
        return self._state(self.truth)

    @property
    def true_state_estimated(self) -> State:
        """True centre x, y [px], angle, from right towards down [rad], and scale (1 in the first
        frame) of the target in the picture from which `estimate` was made, which is older than this
        frame if the tracker is slow.
        """
        return self._state(self.truth_estimated)

    def _state(self, truth: Truth) -> State:
        x, y = truth.centre.tolist()
        return State(x, y, truth.theta, truth.size / self.scene.first_size)

    @property
    def corner_errors(self) -> Array:
        """Distances (4,) of the target's true corners in the picture from their places at the goal
        [px]. If the features do not distinguish the target's front from its back, the goal may be
        turned by half a turn: that with the smaller sum of distances counts.
        """
        # The corners of a rectangle turned by half a turn are the same corners, two places on.
        goal = self.goal.corners
        plain, turned = (
            np.hypot(*(self.truth.corners - each).T) for each in (goal, goal[[2, 3, 0, 1]])
        )
        is_turned = turned.sum() < plain.sum() and not self.tells_front_from_back
        return turned if is_turned else plain

    @property
    def T_object_camera(self) -> Pose:
        """True pose of the camera [m] in the frame of the target's reference rectangle: origin in
        its centre, x along the target's nose, z along the normal, away from the camera.
        """
        return self._seen_from_target(self.truth)

    @property
    def T_object_goal(self) -> Pose:
        """Desired pose of the camera [m] in the frame of the target's reference rectangle: origin
        in its centre, x along the target's nose, z along the normal, away from the camera.
        """
        return self._seen_from_target(self.goal)

    def _seen_from_target(self, truth: Truth) -> Pose:
        T_world_object = truth.T_world_target @ self.scene.T_target_object
        return T_world_object.inverse() @ truth.T_world_camera

    @property
    def target_motion_true(self) -> Array:
        """True mean rate (k,), in the units of the k features per second, at which the target's own
        motion changed the features over the last frame interval, seen from the camera's pose at
        this frame; all nan if the features are made of pixels.
        """
        if self.goal_sight.picture is not None:
            return self._unknown
        return self.scene.true_motion(
            self.truth.T_world_camera,
            self.target_before,
            self.truth.T_world_target,
            self.goal_sight,
            self.scene.period,
        )

    @property
    def features(self) -> Array:
        """Features s (k,) as last measured, in their own units; all nan before the law's first
        command, and if the controller uses no features.
        """
        return self._unknown if self.command.trace is None else self.command.trace.features

    @property
    def error(self) -> Array:
        """Feature error e = s - s* (k,) as last measured, in the features' units; all nan before
        the law's first command, and if the controller uses no features.
        """
        return self._unknown if self.command.trace is None else self.command.trace.error

    @property
    def prediction(self) -> Prediction:
        """The estimator's latest prediction (feature error, rate of the features from the target's
        own motion, innovation), in the features' own units; all nan before the law's first command,
        and if the controller uses no features (a policy).
        """
        trace = self.command.trace
        if trace is not None:
            return trace.prediction
        return Prediction.unmeasured(self._unknown, self._unknown)

    @property
    def _unknown(self) -> Array:
        return np.full(len(self.scene.features.names), np.nan)

    @property
    def servoed(self) -> tuple[bool, bool]:
        """Two flags: whether the target's angle is servoed, and whether its size is. A quantity is
        servoed if the tracker follows it or reports corners, and a feature that the robot's joints
        can change needs it; the size only while the loop does not refuse it as impossible.
        """
        estimate = self.estimate
        follows = np.array(estimate.follows) | (estimate.corners is not None)
        follows &= (True, estimate.likely_scale is None)
        angle, size = (follows & self.needed).tolist()
        return angle, size

    @property
    def needed(self) -> tuple[bool, bool]:
        """Two flags: whether some feature that the robot's joints can change needs the target's
        angle, and whether one needs its size.
        """
        goal = self.goal_sight
        known = self.scene.features.known
        # A feature needs the angle if it would not be measured without it; so with the size.
        without = (replace(goal, angle_known=False), replace(goal, size_known=False))
        trace = self.command.trace
        by_joints = True if trace is None or trace.servoed is None else trace.servoed
        neither = known(replace(goal, angle_known=False, size_known=False))
        if goal.picture is None and neither.all():
            # The set counts as measured whatever the tracker follows: what changes it is needed.
            nearer = Pose(goal.pose.rotation, NEARER * goal.pose.translation)
            return self._tells(goal.pose @ TURNED), self._tells(nearer)
        angle, size = (bool((known(goal) & ~known(s) & by_joints).any()) for s in without)
        return angle, size

    def _tells(self, pose: Pose) -> bool:
        """Return whether a feature that the robot's joints can change differs by a hundredth of
        its scale or more where the camera sees the target at a pose, not at its goal.
        """
        features = self.scene.features
        wanted = features.values(self.goal_sight)
        seen = features.values(sight_of(pose, self.scene.outline, self.goal_sight))
        apart = np.abs(features.error(seen, wanted)) / features.scales(wanted)
        trace = self.command.trace
        by_joints = True if trace is None or trace.servoed is None else trace.servoed
        return bool(((apart > LEAST_CHANGE) & by_joints).any())

    @property
    def servoes_pose(self) -> bool:
        """Whether all six degrees of freedom of the camera are servoed: the features determine
        them, and the robot's joints can move them.
        """
        trace = self.command.trace
        if trace is not None and trace.servoed is not None and not trace.servoed.all():
            return False
        goal = self.goal_sight
        if goal.picture is not None:
            return True  # pixels are servoed
        # Four features, or six that depend on each other, leave some motion of the camera free.
        return int(np.linalg.matrix_rank(self.scene.features.matrix(goal))) == DOF

    @property
    def rotation_error(self) -> float:
        """Angle [rad], 0 to pi, of the rotation between the camera's true and its desired
        orientation, both relative to the target.
        """
        return angle_of(self.T_object_goal.rotation.T @ self.T_object_camera.rotation)

    @property
    def tells_front_from_back(self) -> bool:
        """Whether the features distinguish the target's nose from its rear: they change if the
        target at its goal is turned by 180 degrees about its normal. True for features made of
        pixels.
        """
        goal = self.goal_sight
        if goal.picture is not None:
            return True  # pixels are servoed
        features = self.scene.features
        around = sight_of(goal.pose @ HALF_TURN, self.scene.outline, goal)
        error = features.error(features.values(around), features.values(goal))
        return bool(np.abs(error).max() > ROUNDING)

    @property
    def joints(self) -> Array:
        """Exact joint positions (n,) of the robot at the time of the frame [m or rad], without
        errors of encoders.
        """
        return self.posture.joints

    @property
    def margins(self) -> Array:
        """Distance (n,) of each joint from its nearer limit [m or rad], below 0 beyond it; inf for
        a joint without limits.
        """
        p = self.posture
        return np.minimum(p.joints - p.lower, p.upper - p.joints)

    @property
    def twist_measured(self) -> Array:
        """Mean twist (6,) that the camera had over the last frame interval, in its own frame [m/s,
        rad/s]. It is the simulation's exact one, without errors of encoders and calibration,
        relative to the world, or to the target if the robot holds that.
        """
        return self.posture.twist

    @property
    def tilt(self) -> float:
        """True angle between the camera's optical axis and straight down [rad], 0 to pi."""
        return tilt(self.truth.T_world_camera.rotation)

    @property
    def tracked(self) -> bool:
        """Whether the camera delivered a new picture in this frame, and the tracker was called
        before the next frame; False for the first frame.
        """
        return self.frame.index > 0 and self.frame.fresh and self.seconds.track > 0

    @property
    def seen(self) -> bool:
        """Whether the camera delivered a new picture in this frame, and the status of the tracker's
        latest estimate is LOCKED.
        """
        return self.frame.fresh and self.estimate.status is Status.LOCKED

    @property
    def servo_error(self) -> float:
        """Distance in the picture between the target's true centre and its goal [px]."""
        return float(np.hypot(*(self.truth.centre - self.goal.centre)))

    @property
    def tracking_error(self) -> float:
        """Distance between the estimated and the true centre of the target [px], in the picture
        from which the estimate was made.
        """
        estimated = np.array([self.estimate.state.x, self.estimate.state.y])
        return float(np.hypot(*(estimated - self.truth_estimated.centre)))
