"""One run: a world and the loop that watches and steers in it, as an iterator of steps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from functools import cached_property
from math import radians
from time import perf_counter
from typing import Any

import numpy as np

from servo.loop.goal import Goal
from servo.loop.loop import Loop
from servo.loop.part_checks import check_built
from servo.loop.part_failed import PartFailed, parts_named
from servo.loop.step import Scene, Seconds, Step
from servo.loop.timeline import Taken, Timeline, mean_twist
from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS
from servo.scenario.draws import stream
from servo.scenario.load import Scenario
from servo.scenario.sections import StartConfig
from servo.types import Sight
from sim.camera.renderer import MakeRenderer, OpenGLRenderer
from sim.geometry import exp_so3
from sim.robot.start_pose import Reach
from sim.types import Array, Image, Pose, Truth
from sim.world import Unstable, World, WorldParts
from tracking.types import Region, State

DRAW_NOTHING = ("sim.robots.", "sim.targets.")
"""Modules of parts that are the same in all runs."""


class Episode:
    """A run that is ready to begin; iterate over it once, and close it.

    Raises:
        Mistake: The scenario asks for something that cannot be, in one sentence.
        PartFailed: A part raised an exception; the sentence names it.
        NoRenderer: This machine cannot render.
    """

    def __init__(
        self,
        scenario: Scenario,
        renderer: MakeRenderer = OpenGLRenderer,
        *,
        steered: bool = False,
        kept: dict[str, tuple[Any, Any]] | None = None,
    ) -> None:
        """Prepare a run; steered: `move` will be given twists; kept: robot and target of an earlier
        episode, used again where their settings are the same, else replaced by this one's.
        """
        self.scenario = scenario
        self.frames = scenario.frames
        self._steered = steered
        self._kept = {} if kept is None else kept
        self._parts: dict[str, tuple[Any, ...]] = {n: (getattr(scenario, n),) for n in PLUGINS}
        self._parts |= {f"disturbances[{i}]": (d,) for i, d in enumerate(scenario.disturbances)}
        with ExitStack() as unless_ready, self.naming_parts():
            unless_ready.callback(self.close)  # the caller has nothing to close
            self.world = self._build_world(renderer)
            true = self.world.camera
            believed = self.world.camera_believed
            outline = self.world.outline
            self.loop = Loop(scenario, believed, outline, true)
            self.goal = Goal(scenario.goal, outline, true, true)
            self._parts |= self.loop.parts
            goal = self._picture_at_goal() if self.loop.uses_pictures else None
            self._place_camera(scenario.start)
            self._begin(goal)
            unless_ready.pop_all()

    def close(self, *_: object) -> None:
        """Release the world; also as a context manager."""
        if hasattr(self, "world"):
            self.world.close()

    def __enter__(self) -> Episode:
        return self

    __exit__ = close

    def naming_parts(self) -> AbstractContextManager[None]:
        """Turn an exception of a part's code into a sentence that names the part."""
        return parts_named(self._parts)

    def _build_world(self, renderer: MakeRenderer) -> World:
        s = self.scenario
        motion, robot, target = map(self._build, ("motion", "robot", "target"))
        disturbances = [
            self._build(f"disturbances[{i}]", f"disturbance {i}")
            for i in range(len(s.disturbances))
        ]
        sensor, encoders = (stream(s.run.seed, name) for name in ("sensor", "encoders"))
        try:
            parts = WorldParts(robot, target, motion, disturbances, s.camera, s.believed, s.world)
            return World(parts, sensor, encoders, renderer)
        except ValueError as error:
            raise Mistake(f"{s.name}: {error}") from error

    def _build(self, part: str, draws: str = "") -> Any:
        """What the `Config` of a part builds; a ValueError is the user's mistake."""
        config = self._parts[part][0]
        before, built = self._kept.get(part, (None, None))
        if before != config:
            try:
                built = config.build(stream(self.scenario.run.seed, draws or part))
            except ValueError as error:
                raise Mistake(f"{self.scenario.name}: {part}: {error}") from error
        if type(config).__module__.startswith(DRAW_NOTHING):
            self._kept[part] = config, built
        self._parts[part] = config, check_built(part, config, built)
        return built

    def _picture_at_goal(self) -> Image:
        """What the camera sees where it shall be: "teaching by showing"."""
        self._place_camera(StartConfig())
        return self.world.look().image

    def _place_camera(self, start: StartConfig) -> None:
        name = self.scenario.name
        try:
            reach = self._start(start)
        except ValueError as error:
            raise Mistake(f"{name}: start: {error}") from None
        if not reach:
            raise Mistake(
                f"{name}: start: the robot cannot bring the camera where this picture is taken: "
                f"{reach}"
            )

    def _start(self, start: StartConfig) -> Reach:
        if start.pose is not None:
            t = np.array(start.pose[:3])
            thetau = np.radians(start.pose[3:])
            return self.world.start_facing(Pose(exp_so3(thetau), t))
        pixel = self.goal.pixel + (start.x, start.y)
        theta = self.goal.theta + radians(start.angle_deg)
        depth = self.scenario.goal.depth / start.scale
        tilt = radians(start.tilt_deg), radians(start.tilt_towards_deg)
        return self.world.start(pixel, theta, depth, *tilt)

    def _begin(self, goal: Image | None) -> None:
        """Take the first frame and start the loop with the region that the scenario gives."""
        scenario = self.scenario
        world = self.world
        first = world.look()
        truth = self._truth()
        length, width = np.ptp(world.outline[:, :2], axis=0)
        change = scenario.region
        sides = np.array([length * change.width, width * change.height]) * truth.size
        x, y = truth.centre + (change.x, change.y)
        given = State(float(x), float(y), truth.theta + radians(change.angle_deg), 1.0)
        region = Region(*sides.tolist(), quad=change.corners(truth))
        try:
            self.loop.start(first, region, given, goal)
        except ValueError as error:
            raise Mistake(f"{scenario.name}: {error}") from None
        self._first = (first, truth)
        self._looked = False
        self._scene = Scene(
            world.camera,
            world.outline,
            region,
            truth.size,
            self.loop.features,
            world.period,
            world.model,
        )

    def _truth(self) -> Truth:
        truth = self.world.truth()
        if not np.isfinite(truth.corners).all():
            motion = self.scenario.motion
            pose = truth.T_world_target
            where = f"the target's position is {pose.translation}, its rotation {pose.rotation}"
            raise PartFailed.by("motion", motion, f"{where}; all must be finite")
        return truth

    def _motion_true(self, truth: Truth, begin: float, end: float) -> Array:
        """True mean de/dt (k,) of the target's own motion between two times [s], seen by a camera
        that went along with it from a truth until then.
        """
        before, after = map(self.world.target_at, (begin, end))
        camera = before @ truth.T_world_target.inverse() @ truth.T_world_camera
        goal = self.loop.goal_sight
        return self._scene.true_motion(camera, before, after, goal, end - begin)

    @cached_property
    def _timeline(self) -> Timeline:
        run = self.scenario.run
        world = self.world
        draws = stream(run.seed, "transport")
        first = self._first[1]
        lies = 1e-3 * self.scenario.believed.clock_offset_ms
        return Timeline(
            run,
            self.loop,
            world.period,
            world.ticks,
            draws,
            first,
            self._motion_true,
            lies,
            steered=self._steered,
        )

    def _goal_sight(self, time: float) -> Sight:
        """How the target shall be seen, by the true camera."""
        believed = self.loop.goal_sight
        world = self.world
        if world.camera_believed is world.camera:
            return believed
        return replace(self.goal.sight(time), picture=believed.picture)

    def _move(self, twists: Array) -> bool:
        try:
            return self.world.step(twists)
        except Unstable as error:
            raise PartFailed.by("robot", self.scenario.robot, str(error)) from error

    def __iter__(self) -> Iterator[Step]:
        with self.naming_parts():
            for _ in range(self.frames):
                yield self.move(self.look())

    def look(self) -> Step:
        """Take the next picture, track and decide; the step, before the camera moves on."""
        world = self.world
        loop = self.loop
        timeline = self._timeline
        posture = world.posture()
        (frame, truth) = self._first
        rendering = 0.0
        if self._looked:
            began = perf_counter()
            frame = world.look()
            rendering = perf_counter() - began
            truth = self._truth()
        self._looked = True
        timeline.advance(Taken(frame, world.believed(posture), truth))
        decision = timeline.decision
        return Step(
            scene=self._scene,
            frame=frame,
            truth=truth,
            target_before=world.target_before(),
            goal=self.goal.pixel,
            goal_theta=self.goal.theta,
            goal_size=self.goal.size(frame.time),
            goal_sight=self._goal_sight(frame.time),
            estimate=loop.estimate,
            truth_estimated=decision.truth,
            age=decision.age,
            skipped=decision.skipped,
            command=decision.command,
            motion_measured=loop.motion_measured,
            bodies=world.bodies(),
            posture=posture,
            rates=world.robot.rates_measured(world.data),
            twist_acting=np.zeros(6),
            limited=False,
            seconds=Seconds(rendering, *timeline.seconds, 0.0),
        )

    def move(self, step: Step, twist: Array | None = None) -> Step:
        """Move until the next picture; the whole step.

        Args:
            step: What `look` gave.
            twist: Acts in place of the law's (6,), if the law decided on something in this step.
        """
        if twist is not None:
            self._timeline.steer(twist)
        acting = self._timeline.acting()
        command = self._timeline.decision.command
        began = perf_counter()
        limited = self._move(acting)
        seconds = replace(step.seconds, physics=perf_counter() - began)
        return replace(
            step, command=command, twist_acting=mean_twist(acting), limited=limited, seconds=seconds
        )


def run(scenario: Scenario) -> Iterator[Step]:
    """The steps of one run, from the first frame to the last."""
    with Episode(scenario) as episode:
        yield from episode
