"""One run: the loop of looking, tracking, commanding and moving, as an iterator of steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from math import radians
from time import perf_counter

import numpy as np

from servo import features
from servo.eyes import Eyes
from servo.mistake import Mistake
from servo.scenario import Scenario
from servo.step import Scene, Seconds, Step
from servo.types import Command, Sight, Task
from sim.types import Frame, Posture, Truth
from sim.world import World
from tracking.types import Estimate, Region, State, Status, Tracker, unknown_covariance


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
        robot, sensor = s.robot.build(stream(seed, "robot")), stream(seed, "sensor")
        try:
            self.world = World(s.world, robot, s.camera, motion, disturbances, sensor)
        except ValueError as error:
            raise Mistake(f"{s.name}: {error}") from None
        self.frames = max(1, round(s.run.duration * s.camera.rate))
        camera, outline = self.world.camera, self.world.outline
        root_area = float(np.sqrt(np.prod(np.ptp(outline[:, :2], axis=0))))
        self.scale = s.features.scaling.factor(root_area)
        self.goal = np.array([camera.width / 2 + s.goal.x, camera.height / 2 + s.goal.y])
        self.goal_theta = radians(s.goal.angle_deg)
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
                f"{name}: start: the robot cannot bring the camera where this picture is taken"
            )

    def _begin(self) -> None:
        """Take the first frame, show it to the tracker, and tell the controller its task."""
        scenario, world = self.scenario, self.world
        first, truth = world.look(), world.truth()
        length, width = np.ptp(world.outline[:, :2], axis=0)
        change = scenario.region
        region = Region(length * truth.size * change.width, width * truth.size * change.height)
        x, y = truth.centre + (change.x, change.y)
        given = State(float(x), float(y), truth.theta + radians(change.angle_deg), 1.0)
        try:
            self.tracker.start(first, region, given)
        except ValueError as error:
            raise Mistake(f"{scenario.name}: first frame: {error}") from None
        # The tracker has not said yet what it follows: angle and size wait for its first word.
        told = Estimate(given, unknown_covariance(), 0.0, Status.LOCKED, follows=(False, False))
        self._first = first, truth, told
        self.eyes = Eyes(scenario.features, world.camera, region, world.outline)
        self._carried = np.zeros(4)
        self._scene = Scene(
            world.camera, world.outline, region, truth.size, self.scale, world.period
        )
        self.controller = scenario.controller.build(stream(scenario.run.seed, "controller"))
        estimator = scenario.estimator.build(stream(scenario.run.seed, "estimator"))
        goal = self._goal_sight(0.0)
        self.controller.start(Task(goal, self.scale, estimator, scenario.run.latency))

    def _goal_size(self, time: float) -> float:
        return self.world.camera.focal / self.scenario.goal.depth_at(time)

    def _goal_sight(self, time: float) -> Sight:
        length, width = np.ptp(self.world.outline[:, :2], axis=0) * self._goal_size(time)
        x, y = self.goal.tolist()
        state = State(x, y, self.goal_theta)
        m = features.moments_of_state(state, Region(length, width), self.world.camera)
        return self.eyes.goal(m)

    def __iter__(self) -> Iterator[Step]:
        world = self.world
        waiting = deque([np.zeros(6)] * self.scenario.run.latency)
        frame, truth, estimate = self._first
        rendering = tracking = 0.0
        for index in range(self.frames):
            posture = world.posture()
            if index > 0:
                began = perf_counter()
                frame = world.look()
                rendered = perf_counter()
                estimate = self._track(frame, estimate, posture)
                rendering, tracking = rendered - began, perf_counter() - rendered
                truth = world.truth()
            began = perf_counter()
            command = self._command(frame, estimate, truth, posture)
            waiting.append(command.twist)
            controlling = perf_counter() - began
            rates, bodies = world.robot.rates_measured(world.data), world.bodies()
            before, acting = world.target_before(), waiting.popleft()
            began = perf_counter()
            limited = world.step(acting)
            seconds = Seconds(rendering, tracking, controlling, perf_counter() - began)
            yield Step(
                scene=self._scene, frame=frame, truth=truth, target_before=before,
                goal=self.goal, goal_theta=self.goal_theta, goal_size=self._goal_size(frame.time),
                estimate=estimate, command=command, bodies=bodies, posture=posture, rates=rates,
                twist_acting=acting, limited=limited, seconds=seconds,
            )  # fmt: skip

    def _track(self, frame: Frame, before: Estimate, posture: Posture) -> Estimate:
        """The next estimate; of a dropped frame the tracker never hears, its last word stays."""
        ego = None
        if self.scenario.run.ego:
            self._carried += self.eyes.ego(before.state, posture.twist, self.world.period)
            ego = self._carried
        if not frame.fresh:
            return before
        self._carried = np.zeros(4)
        return self.tracker.update(frame, ego)

    def _command(self, frame: Frame, estimate: Estimate, truth: Truth, posture: Posture) -> Command:
        if self.scenario.goal.depth_to is not None:
            self.controller.aim(self._goal_sight(frame.time))
        seen = self.eyes.see(estimate, truth, posture) if frame.fresh else None
        return self.controller.command(seen, posture, self.world.period)


def run(scenario: Scenario) -> Iterator[Step]:
    """The steps of one run, from the first frame to the last."""
    with Episode(scenario) as episode:
        yield from episode
