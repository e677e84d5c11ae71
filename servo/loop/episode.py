"""One run of a scenario: a simulated world, and a loop of tracker and control law that acts in it,
frame by frame.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from math import radians
from time import perf_counter
from typing import Any

import numpy as np

from servo.goals.faced import Faced
from servo.goals.picture_world import AtGoalConfig
from servo.loop.inputs import check_type
from servo.loop.loop import Loop
from servo.loop.part_failures import Part, PartFailed
from servo.loop.settings import Setup, StartConfig, stream
from servo.loop.step import Scene, Seconds, Step
from servo.loop.timeline import Schedule, Timeline, mean_twist
from servo.mistake import Mistake
from servo.sight.exact import sight_of
from servo.types import Command, Sight
from sim.camera.renderer import MakeRenderer, Unseen
from sim.channels import Channel
from sim.geometry import exp_so3
from sim.kinematics.inverse_kinematics import Reach
from sim.kinematics.rollout import FORESEEN, STEP
from sim.outline import Outline
from sim.placement import object_frame, object_pose
from sim.surroundings import Surroundings
from sim.types import Array, Frame, Image, Pose, Truth
from sim.world import Moment, Unstable, World, WorldParts
from tracking.evaluation.warm_up import warm_up
from tracking.types import Region, State

Kept = dict[str, tuple[object, object]]
"""Settings and component by the place in the scenario, of components that a later run may reuse."""


@dataclass(frozen=True, slots=True)
class Advance:
    """Motion of the simulated world over one frame interval: the mean (6,) of the camera twists
    that were commanded [m/s, rad/s], in the camera frame; the names of the joints that were at a
    limit; and the wall-clock time of the physics [s].
    """

    twist: Array
    """Mean of the twists asked for (6,)."""
    limits: tuple[str, ...]
    """The joints at a limit, such as "elbow (range)"."""
    seconds: float
    """Wall-clock time of the physics [s]."""


KEPT = ("robot", "target")
"""Components that an episode leaves to the next one if they used no random numbers."""


class ImpossibleStart(Mistake):
    """Error: the start pose (or the goal pose, if a picture is taken there) does not exist, or the
    robot cannot reach it. If the scenario draws its start, the start of another seed may be
    possible.
    """


class Episode:
    """One run of a scenario: a simulated world, and the loop of tracker and control law that acts
    in it, ready to begin. Iterating over it, once, yields the steps of the run, one for each frame;
    as a context manager it closes its world at the end.

    Raises:
        Mistake: The scenario's settings contradict each other or are impossible; `ImpossibleStart`
            if the robot cannot reach the start pose.
        PartFailed: A component (tracker, robot, ...) raised an exception; the message names it.
        NoRenderer: This machine cannot render.
    """

    def __init__(
        self,
        scenario: Setup,
        renderer: MakeRenderer | None = None,
        *,
        steered: bool = False,
        seen: bool = True,
        shows_goal: bool = False,
        kept: Kept | None = None,
    ) -> None:
        """Build the world and the loop of a scenario, and take the first picture.

        Args:
            scenario: Settings of the run.
            renderer: Function that makes the renderer; None: the one that the camera's settings
                name.
            steered: Whether `move` will be given twists that replace those of the law.
            seen: Whether the caller uses the pictures. If neither the caller nor the loop uses
                them, and neither depth pictures nor the target's visibility are needed, nothing is
                rendered, and they are black.
            shows_goal: Whether to take the picture at the goal even if the loop does not need it.
            kept: Dictionary of robot and target of an earlier episode. This episode uses them again
                if their settings are the same; otherwise it stores its own there, except those that
                drew random numbers.
        """
        check_type("scenario", scenario, Setup)
        self.scenario = scenario
        self.frames = scenario.frames
        self._kept = {} if kept is None else kept
        with ExitStack() as unless_ready:
            unless_ready.callback(self.close)  # the caller has nothing to close
            self.world = self._build_world(scenario, renderer, seen=seen or shows_goal)
            outline = self.world.outline
            with self._refusals():
                believed = scenario.believed.outline(outline)
                self.loop = Loop(scenario, self.world.camera_believed, believed, self.world.camera)
            self.goal = Faced(scenario.goal, outline, self.world.camera, self.world.camera)
            """The goal for the true camera, if there is no leader."""
            needs_goal = Channel.GOAL_PICTURE in scenario.needs
            goal = self._picture_at_goal(renderer) if needs_goal or shows_goal else None
            self.goal_picture = goal
            """The picture (H, W, 3) that the camera takes at the goal, if it was taken."""
            self.begun = self._place_camera(self.world, scenario.start, self._way)
            """How well the robot reaches the start pose, and follows the motion with its joints."""
            moment = self.world.moment()
            first = moment.picture()
            self._moment: Moment | None = replace(moment, picture=lambda: first)
            """The moment of the next picture, if its rendering has begun."""
            self._advances = deque[Advance]()
            """Motions of the world since the last picture, one for each frame interval."""
            self._truths = {first.index: moment.truth}
            """The truth of each picture by its number, from that of the last decision on."""
            self._start_loop(first, moment.truth, goal if needs_goal else None, steered=steered)
            unless_ready.pop_all()

    def close(self, *_: object) -> None:
        """Close the world and its renderer, and release the running loop, so that a tracker's
        process can end. The episode cannot be used afterwards.

        Args:
            _: The exception that ended a `with` block; ignored.
        """
        if hasattr(self, "world"):
            self.world.close()
        # Both refer to this episode for the truth: the cycle would keep a tracker's process alive.
        for asking in ("running", "_timeline"):
            vars(self).pop(asking, None)

    def __enter__(self) -> "Episode":
        return self

    __exit__ = close

    def _build_world(
        self, s: Setup, renderer: MakeRenderer | None, *, seen: bool, clutter: str = "clutter"
    ) -> World:
        """Build the world of a scenario.

        Args:
            s: The scenario.
            renderer: Function that makes the renderer; None: the one that the camera's settings
                name.
            seen: Whether the caller uses the pictures.
            clutter: Name of the random stream of the clutter.
        """
        motion = self._build(Part("motion", s.motion))
        robot = self._build(Part("robot", s.robot))
        target = self._build(Part("target", s.target))
        disturbances = [
            self._build(Part(f"disturbances[{i}]", config), f"disturbance {i}")
            for i, config in enumerate(s.disturbances)
        ]
        names = "sensor", "encoders", "depth"
        sensor, encoders, depth = (stream(s.run.seed, name) for name in names)
        around = Surroundings(s.ground, s.walls, s.clutter, s.light, stream(s.run.seed, clutter))
        parts = WorldParts(
            robot, target, motion, disturbances, s.camera, s.believed, s.world, around, s.leader
        )
        seen |= Channel.PICTURE in s.needs or s.world.visibility or s.camera.depth
        with self._refusals():
            make = (renderer or s.recording.renderer()) if seen else Unseen
            return World(parts, sensor, encoders, make, depth)

    @contextmanager
    def _refusals(self, where: str = "", kind: type[Mistake] = Mistake) -> Generator[None]:
        """Context manager: turn a ValueError in the block into an error whose message begins with
        the scenario's name; a `PartFailed` passes unchanged.

        Args:
            where: Beginning of the message after the name, such as "start: ".
            kind: Class of the error.
        """
        try:
            yield
        except PartFailed:
            raise
        except ValueError as error:
            raise kind(f"{self.scenario.name}: {where}{error}") from error

    def _build(self, part: Part, draws: str = "") -> Any:
        """Build a component from its `Config`; return the component that an earlier episode left if
        its settings are the same.

        Args:
            part: Section of the scenario, and its settings.
            draws: Name of the random stream that the component is given; "": the name of its
                section.
        """
        before, built = self._kept.get(part.place, (None, None))
        # Building a robot or a target reads meshes and compiles a model, which takes seconds.
        if before == part.config:
            return built
        rng = stream(self.scenario.run.seed, draws or part.place)
        unused = rng.bit_generator.state
        with self._refusals():
            built = part.build(rng)
        # A component that drew random numbers depends on the seed, so it is not kept.
        if part.place in KEPT and rng.bit_generator.state == unused:
            self._kept[part.place] = part.config, built
        return part.guarded(built) if hasattr(built, "at") else built

    def _picture_at_goal(self, renderer: MakeRenderer | None) -> Image:
        """Return the camera's picture (H, W, 3) at the goal ("teaching by showing"), in a world of
        its own if [at_goal] says that something differed.
        """
        s = self.scenario
        there = StartConfig(tilt_deg=s.goal.tilt_deg, tilt_towards_deg=s.goal.tilt_towards_deg)
        if s.at_goal == AtGoalConfig():
            self._place_camera(self.world, there, pose="goal")
            return self.world.look().image
        then = replace(
            s,
            camera=s.at_goal.camera(s.camera),
            light=s.at_goal.light(s.light),
            clutter=s.at_goal.clutter(s.clutter),
        )
        clutter = "clutter at goal" if s.at_goal.clutter_moved else "clutter"
        world = self._build_world(then, renderer, seen=True, clutter=clutter)
        with closing(world):
            self._place_camera(world, there, pose="goal")
            return world.look().image

    def _way(self) -> list[Pose]:
        """Return the desired poses of the camera in the first seconds of the run, every `STEP` s,
        as if the camera were always exactly at its goal: T_world_camera, or T_target_camera if the
        robot holds the target.
        """
        # A camera whose features do not control the angle keeps its heading.
        known = self.loop.law.features.known
        goal = self.goal.sight_at(0.0)
        turns = bool((known(goal) & ~known(replace(goal, angle_known=False))).any())
        times = np.arange(0.0, min(self.scenario.run.duration, FORESEEN), STEP).tolist()
        # The goal of a facing camera depends on the depth alone, so each depth is solved once.
        depths = [self.scenario.goal.depth_at(time) for time in times]
        ends = dict(zip(depths, times, strict=True))
        faced = {depth: self.goal.sight_at(time).pose for depth, time in ends.items()}
        return [
            self.world.eye_at_goal(time, faced[depth], turns=turns)
            for time, depth in zip(times, depths, strict=True)
        ]

    def _place_camera(
        self,
        world: World,
        start: StartConfig,
        way: Callable[[], list[Pose]] | None = None,
        pose: str = "start",
    ) -> Reach:
        seed = self.scenario.run.seed
        drawn = f", seed {seed}" * (seed != 0)  # of seed 0 nothing is drawn
        with self._refusals(f"{pose}{drawn}: ", ImpossibleStart):
            reach = self._start(world, start, way)
            if not reach:
                carried = world.robot.mounting.carried
                hint = world.robot.advice
                raise ValueError(
                    f"the robot cannot bring the {carried} to its {pose} pose: {reach}; change "
                    f"[start] or [goal]{hint}"
                )
        return reach

    def _start(
        self, world: World, start: StartConfig, way: Callable[[], list[Pose]] | None
    ) -> Reach:
        if start.pose is not None:
            turn = exp_so3(np.radians(start.pose[3:]))
            return world.start_facing(Pose(turn, np.array(start.pose[:3])), way)
        # Relative to the goal: beside a leader that of the first picture.
        led = world.goal()
        pixel = self.goal.pixel if led is None else led.centre
        theta = self.goal.theta if led is None else led.theta
        pose = None if led is None else object_pose(led, world.outline)
        depth = self.scenario.goal.depth if pose is None else float(pose.translation[2])
        return world.start(
            pixel + (start.x, start.y),
            theta + radians(start.angle_deg),
            depth / start.scale,
            radians(start.tilt_deg),
            radians(start.tilt_towards_deg),
            way,
        )

    def _start_loop(self, first: Frame, truth: Truth, goal: Image | None, *, steered: bool) -> None:
        """Start the loop with the first picture and the region that the scenario gives to the
        tracker.
        """
        scenario = self.scenario
        world = self.world
        outline = Outline(world.outline)
        change = scenario.region
        sides = (
            np.array([outline.length * change.width, outline.width * change.height]) * truth.size
        )
        x, y = truth.centre + (change.x, change.y)
        given = State(float(x), float(y), truth.theta + radians(change.angle_deg), 1.0)
        region = Region(*sides.tolist(), quad=change.corners(truth))
        self.shown = first, region, given
        """The first picture, and the region and state given to the tracker."""
        if not scenario.run.repeats:
            warm_up(scenario.tracker)
        with self._refusals():
            self.running = self.loop.start(
                first, region, given, goal, self._true_motion, lambda picture: self._truths[picture]
            )
        self._scene = Scene(
            world.camera,
            world.outline,
            region,
            truth.size,
            self.loop.law.features_of_truth,
            object_frame(world.outline),
            world.period,
            world.model,
        )
        offset = 1e-3 * scenario.believed.clock_offset_ms
        schedule = Schedule(scenario.run, world.period, world.ticks, world.shares, offset, steered)
        self._timeline = Timeline(schedule, self.running, stream(scenario.run.seed, "transport"))

    def _true_motion(self, picture: int, begin: float, end: float) -> Array:
        """Return the mean de/dt (k,), in the features' units per second, that the target's own
        motion causes between two times of the run, for a camera at rest that has, at the first
        time, the pose relative to the target that it had in a picture.

        Args:
            picture: Number of that picture, from 0.
            begin: Beginning of the interval [s].
            end: End of the interval [s].
        """
        truth = self._truths[picture]
        before, after = map(self.world.target_at, (begin, end))
        # Where the camera would be had it moved with the target since that picture.
        camera = before @ truth.T_world_target.inverse() @ truth.T_world_camera
        return self._scene.true_motion(camera, before, after, self.running.goal_sight, end - begin)

    def _goal_sight(self, frame: Frame, goal: Truth | None) -> Sight:
        """Return the desired view of the target as the true camera has it; with a leader, that of
        the given true goal.
        """
        if goal is not None:
            return sight_of(object_pose(goal, self.world.outline), self.world.outline)
        # With the same camera believed and true, the loop has already computed it.
        believed = self.running.goal_sight
        if self.world.camera_believed is self.world.camera:
            return believed
        true = self.goal.sight(frame, by_corners=self.running.by_corners)
        return replace(true, picture=believed.picture)

    def _pass(self, twists: Array) -> None:
        """Advance the world by one frame interval.

        Args:
            twists: Camera twists (n, 6) in the camera frame [m/s, rad/s] that act in it, one for
                each update of the drives.

        Raises:
            PartFailed: The simulated physics diverged.
        """
        began = perf_counter()
        try:
            limits = self.world.step(twists)
        except Unstable as error:
            raise Part("robot", self.scenario.robot).failed(str(error)) from error
        mean = mean_twist(twists, self.world.shares)
        self._advances.append(Advance(mean, limits, perf_counter() - began))

    def __iter__(self) -> Iterator[Step]:
        for _ in range(self.frames):
            yield self.move(self.look())

    def look(self) -> Step:
        """Take the next picture, run tracker and law on the pictures that the tracker finishes in
        this frame interval (without delays, on this picture), and return the step (the data of this
        frame). Call `move` next, which moves the camera and completes the step: twist, limits and
        time of the physics are still zero or empty here.
        """
        timeline = self._timeline
        ahead = len(self._advances)
        began = perf_counter()
        now = self._moment or self.world.moment()
        frame = now.picture()
        goal = now.goal or self.goal.truth(frame.time, now.truth.T_world_camera)
        self._moment = self._next_moment(frame.index)
        # `advance` counts the physics of an interval that was stepped just now.
        stepped = sum(passed.seconds for passed in islice(self._advances, ahead, None))
        rendering = perf_counter() - began - stepped
        self._truths[frame.index] = now.truth
        timeline.advance(frame, now.believed)
        latest = timeline.latest
        # Only the pictures that the tracker may still report on are needed.
        self._truths = {i: t for i, t in self._truths.items() if i >= latest.picture}
        return Step(
            scene=self._scene,
            frame=frame,
            truth=now.truth,
            target_before=now.target_before,
            goal=goal,
            goal_sight=self._goal_sight(frame, now.goal),
            estimate=latest.decision.estimate,
            truth_estimated=self._truths[latest.picture],
            picture=latest.picture,
            decided=timeline.decided > 0,
            age=latest.age,
            skipped=latest.skipped,
            command=latest.command,
            motion_measured=latest.decision.motion_measured,
            bodies=now.bodies,
            posture=now.posture,
            rates=now.rates,
            twist_acting=np.zeros(6),
            limited=False,
            joint_limits=(),
            seconds=Seconds(rendering, timeline.track_seconds, timeline.law_seconds, 0.0),
        )

    @property
    def sight(self) -> Sight | None:
        """The target in the picture from which the law's last command was computed: moments and
        corners in normalised image coordinates, plane and pose in the camera frame; None if the
        target was not seen in it, or the law has not computed a command yet.
        """
        return self._timeline.latest.decision.sight

    @property
    def law_twist(self) -> Array:
        """Camera twist (6,) of the law's last decision, in the camera frame [m/s, rad/s], whether
        or not another one acts in its place.
        """
        return self._timeline.latest.decision.command.twist

    def _next_moment(self, index: int) -> Moment | None:
        """Advance the world by one frame interval ahead of the loop, unless it is ahead already,
        begin to render the next picture, and return its moment, so that the loop works meanwhile.
        Do nothing and return None if a command from the present picture could still act in that
        interval, or the present frame is the last one.

        Args:
            index: Number of the present frame, from 0.
        """
        if not self._timeline.is_known_ahead or index + 1 == self.frames:
            return None
        if not self._advances:
            self._pass(self._timeline.acting())
        return self.world.moment()

    def move(self, step: Step, twist: Array | None = None) -> Step:
        """Advance the world by one frame interval, and return the step with the data of this
        motion: commanded twist, joints at a limit, and the physics' wall-clock time [s].

        Args:
            step: The step that `look` returned.
            twist: Camera twist (6,) in the camera frame [m/s, rad/s] that replaces the law's
                commands of this step (only for an episode made with `steered=True`); without a new
                command in this step it has no effect. None: the law's commands act.
        """
        passed = self.advance(twist)
        command = self._timeline.latest.command
        held = () if twist is not None else self._held_by(command)
        limits = tuple(dict.fromkeys((*passed.limits, *held)))
        return replace(
            step,
            command=command,
            twist_acting=passed.twist,
            limited=bool(limits),
            joint_limits=limits,
            seconds=Seconds(
                step.seconds.render, step.seconds.track, step.seconds.control, passed.seconds
            ),
        )

    def advance(self, twist: Array | None = None) -> Advance:
        """Advance the world by one frame interval, and return what happened in it: the mean of the
        commanded camera twists, the joints at a limit, and the wall-clock time of the physics.
        `move` does the same, and stores the result in a step.

        Args:
            twist: Camera twist (6,) in the camera frame [m/s, rad/s] that replaces the law's
                commands of this step (only for an episode made with `steered=True`); without a new
                command in this step it has no effect. None: the law's commands act.
        """
        if twist is not None:
            self._timeline.steer(twist)
        # Ahead of the loop the world has already moved on to the next picture: begin the one after
        # it, whose commands are known.
        if not self._advances:
            self._pass(self._timeline.acting())
        elif self._moment is not None:
            self._pass(self._timeline.acting(later=1))
        return self._advances.popleft()

    def _held_by(self, command: Command) -> list[str]:
        """Return the names of the joints that the law holds at an end of their range, such as
        "elbow (range)".
        """
        held = None if command.trace is None else command.trace.held
        if held is None:
            return []
        return [
            f"{name} (range)"
            for name, is_held in zip(self.world.robot.names, held, strict=True)
            if is_held
        ]


def run(scenario: Setup) -> Iterator[Step]:
    """Run a scenario: yield its steps (the data of one frame each) from the first frame to the
    last, and close the simulated world at the end. The first `next` builds the world, and raises
    what `Episode` raises for a scenario that cannot run.
    """
    with Episode(scenario) as episode:
        yield from episode
