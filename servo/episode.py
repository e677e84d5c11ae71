"""One run: the loop of looking, tracking, commanding and moving, as an iterator of steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import radians
from time import perf_counter

import numpy as np

from servo import features
from servo.interaction import oriented
from servo.parsing import Mistake
from servo.scenario import Scenario
from servo.types import Command, Moments, Plane, Sight, Task
from sim.geometry import tilt
from sim.types import Array, Frame, Truth
from sim.world import World
from tracking.types import Estimate, Region, State, Status, Tracker


@dataclass(frozen=True, slots=True)
class Seconds:
    """Wall-clock time of the stages of one step [s]."""

    render: float
    track: float
    control: float
    physics: float

    @property
    def total(self) -> float:
        """All stages together [s]."""
        return self.render + self.track + self.control + self.physics


@dataclass(frozen=True, slots=True)
class Step:
    """Everything about one frame and what was done with it. Readers only read."""

    frame: Frame
    truth: Truth
    true_state: State
    """The truth as a tracker would say it: scale 1 in the first frame."""
    region: Region
    """The template that the tracker was given."""
    goal: Array
    """Where the target's centre shall be (2,) [px]."""
    goal_theta: float
    """Direction in which the target's nose shall point [rad]."""
    goal_size: float
    """Size the target shall have [px/m]."""
    estimate: Estimate
    command: Command
    target_motion_true: Array
    """True mean de/dt (4,) of the target's own motion over the last frame interval, in the task's
    scaling.
    """
    bodies: Array
    """Poses (n, 3, 4) of the world's moving bodies, [R | t], in the order of `World.moving`."""
    joints: Array
    """Joint positions (n,) at the time of the frame [m or rad]."""
    rates: Array
    """Joint velocities (n,) then [m/s or rad/s]."""
    twist_acting: Array
    """Camera twist (6,) that is asked for until the next frame: the command of `latency` frames
    ago.
    """
    twist_measured: Array
    """Mean camera twist (6,) over the last frame interval."""
    limited: bool
    """Whether a joint's limit or rate slows the motion until the next frame."""
    seconds: Seconds

    @property
    def tilt(self) -> float:
        """Angle between the optical axis and straight down [rad]."""
        return tilt(self.truth.T_world_camera.rotation)

    @property
    def servo_error(self) -> float:
        """Distance of the target's true centre from the goal [px]."""
        return float(np.hypot(*(self.truth.centre - self.goal)))

    @property
    def tracking_error(self) -> float:
        """Distance of the estimated from the true centre [px]."""
        return float(
            np.hypot(
                *(np.array([self.estimate.state.x, self.estimate.state.y]) - self.truth.centre)
            )
        )


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one part of a run: what one part draws never shifts another's."""
    return np.random.default_rng([seed, *name.encode()])


class Episode:
    """A run that is ready to begin; iterate over it once, and close it.

    Raises:
        Mistake: The scenario asks for something that cannot be, in one sentence.
        NoRenderer: This machine cannot render.
    """

    def __init__(self, scenario: Scenario) -> None:
        s, seed = scenario, scenario.run.seed
        self.scenario = s
        motion = s.motion.build(stream(seed, "motion"))
        disturbances = [
            d.build(stream(seed, f"disturbance {i}")) for i, d in enumerate(s.disturbances)
        ]
        self.tracker: Tracker = s.tracker.build(stream(seed, "tracker"))
        try:
            self.world = World(s.world, s.camera, motion, disturbances, stream(seed, "sensor"))
        except ValueError as error:
            raise Mistake(f"{s.name}: {error}") from None
        self.frames = max(1, round(s.run.duration * s.camera.rate))
        camera, outline = self.world.camera, self.world.outline
        self.root_area = float(np.sqrt(np.prod(np.ptp(outline[:, :2], axis=0))))
        self.scale = s.features.scaling.factor(self.root_area)
        self.goal = np.array([camera.cx + s.goal.x, camera.cy + s.goal.y])
        self.goal_theta = radians(s.goal.angle_deg)
        self.goal_size = camera.fx / s.goal.depth
        try:
            self._place_camera()
            self._begin()
        except BaseException:
            self.close()  # nobody else can
            raise

    def close(self, *_: object) -> None:
        """Give the world back; also as a context manager."""
        self.world.close()

    def __enter__(self) -> Episode:
        return self

    __exit__ = close

    def _place_camera(self) -> None:
        start, name = self.scenario.start, self.scenario.name
        pixel = self.goal + (start.x, start.y)
        theta = self.goal_theta + radians(start.angle_deg)
        if not self.world.start(pixel, theta, self.scenario.goal.depth / start.scale):
            raise Mistake(
                f"{name}: start: the gantry cannot bring the camera where this picture is taken"
            )

    def _begin(self) -> None:
        """Take the first frame, show it to the tracker, and tell the controller its task."""
        scenario, world = self.scenario, self.world
        first, truth = world.look(), world.truth()
        length, width = np.ptp(world.outline[:, :2], axis=0)
        change = scenario.region
        self.region = Region(length * truth.size * change.width, width * truth.size * change.height)
        self.first_size = truth.size
        x, y = truth.centre + (change.x, change.y)
        given = State(float(x), float(y), truth.theta + radians(change.angle_deg), 1.0)
        try:
            self.tracker.start(first, self.region, given)
        except ValueError as error:
            raise Mistake(f"{scenario.name}: first frame: {error}") from None
        # The tracker has not said yet what it follows: angle and size wait for its first word.
        told = Estimate(given, np.zeros((4, 4)), 0.0, Status.LOCKED, follows=(False, False))
        self._first = first, truth, told
        self.controller = scenario.controller.build(stream(scenario.run.seed, "controller"))
        estimator = scenario.estimator.build(stream(scenario.run.seed, "estimator"))
        goal = self._goal_moments()
        facing = features.facing_plane(goal, self.root_area)
        self.controller.start(Task(Sight(goal, facing), self.scale, estimator))

    def _goal_moments(self) -> Moments:
        length, width = np.ptp(self.world.outline[:, :2], axis=0) * self.goal_size
        x, y = self.goal.tolist()
        state = State(x, y, self.goal_theta)
        return features.moments_of_state(state, Region(length, width), self.world.camera)

    def __iter__(self) -> Iterator[Step]:
        world, period = self.world, self.world.period
        waiting = deque([np.zeros(6)] * self.scenario.run.latency)
        frame, truth, estimate = self._first
        clock = [perf_counter()] * 3
        for index in range(self.frames):
            if index > 0:
                clock = [perf_counter()]
                frame = world.look()
                clock.append(perf_counter())
                estimate = self.tracker.update(frame)
                clock.append(perf_counter())
                truth = world.truth()
            began = perf_counter()
            measured = world.twist_measured()
            command = self.controller.command(self._seen(estimate, truth), measured, period)
            waiting.append(command.twist)
            controlled = perf_counter()
            joints, rates = world.robot.joints(world.data), world.robot.rates_measured(world.data)
            motion = self._target_motion(truth)
            bodies = world.bodies()
            acting = waiting.popleft()
            moved = perf_counter()
            limited = world.step(acting)
            seconds = Seconds(
                clock[1] - clock[0], clock[2] - clock[1], controlled - began, perf_counter() - moved
            )
            yield Step(
                frame=frame, truth=truth, true_state=self._true_state(truth), region=self.region,
                goal=self.goal, goal_theta=self.goal_theta, goal_size=self.goal_size,
                estimate=estimate, command=command, target_motion_true=motion,
                bodies=bodies, joints=joints, rates=rates, twist_acting=acting,
                twist_measured=measured, limited=limited, seconds=seconds,
            )  # fmt: skip

    def _seen(self, estimate: Estimate, truth: Truth) -> Sight | None:
        if estimate.status is not Status.LOCKED:
            return None
        m = features.moments_of_state(estimate.state, self.region, self.world.camera)
        angle, size = estimate.follows
        return Sight(m, self._plane(m, truth), known=(True, True, size, angle and oriented(m)))

    def _plane(self, m: Moments, truth: Truth) -> Plane:
        """The target's plane; from the truth only what a calibrated robot over its table knows."""
        if self.scenario.features.plane == "parallel":
            return features.facing_plane(m, self.root_area)
        T_camera_target = truth.T_world_camera.inverse() @ truth.T_world_target
        return features.plane_of(T_camera_target, float(self.world.outline[0, 2]))

    def _true_state(self, truth: Truth) -> State:
        x, y = truth.centre.tolist()
        return State(x, y, truth.theta, truth.size / self.first_size)

    def _target_motion(self, truth: Truth) -> Array:
        """True mean de/dt of the target's own motion: both ends of the interval, seen by the camera
        of now.
        """
        before, now = (
            features.of_moments(features.moments_of(t.corners, self.world.camera), self.scale)
            for t in (self.world.truth_before(), truth)
        )
        return features.error_of(now, before) / self.world.period


def run(scenario: Scenario) -> Iterator[Step]:
    """The steps of one run, from the first frame to the last."""
    with Episode(scenario) as episode:
        yield from episode
