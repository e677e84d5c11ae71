"""The closed loop without a world: pictures and postures in, camera twists out.

It serves a simulated or a real camera and robot alike:

    loop = Loop(scenario, camera, outline)
    running = loop.start(frame, region, state)  # the first picture, and the target in it
    command = running.step(frame, posture)      # for each picture, the first included
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol, final
from weakref import ref

import numpy as np

from servo.contracts import check_followed, check_same_features
from servo.estimators.difference import Difference
from servo.goals.faced import Faced
from servo.goals.led import Led
from servo.goals.shown import Shown
from servo.loop.inputs import check_frame, check_picture, check_posture, check_setup, check_start
from servo.loop.part_failures import Part, PartFailed
from servo.loop.posture_record import elapsed
from servo.loop.settings import Setup, stream
from servo.parts import Controller, Estimator, FeatureSet, Forgets, GoalSource, NeedsTruth, Task
from servo.sight.estimate_to_sight import EstimateToSight
from servo.types import CameraImage, Command, Sight
from sim.targets import tag
from sim.types import Array, Camera, Frame, Image, Posture, Truth
from tracking.types import Estimate, Region, SeesOutline, State, Status, Tracker, unknown_covariance
from tracking.types import NeedsTruth as TrackerNeedsTruth

SAME_SIZE = 0.01
"""Sides that differ by less than this share of them are the same."""
NO_TRUTH = (
    "this estimator needs the true motion of the target (true_motion), which only a simulation "
    "knows; with a real camera choose another one, such as kalman_cv"
)


class TrueMotion(Protocol):
    """The true motion of the target, which a simulation knows."""

    def __call__(self, picture: int, begin: float, end: float) -> Array:
        """Return the mean de/dt (k,) of the target's own motion between two times [s], as the
        camera sees it that took the picture of this number.
        """
        ...


@dataclass(frozen=True, slots=True)
class Observation:
    """A picture, and what the tracker reports of it."""

    frame: Frame
    estimate: Estimate
    interval: float
    """Time since the picture before [s]."""
    seconds: float
    """Wall-clock time of the tracker, or of a policy and the tracker [s]."""
    command: Command | None = None
    """What a controller asks for that is given pictures: it takes time as a tracker does."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What the loop made of an observation."""

    estimate: Estimate
    """What the tracker reported."""
    sight: Sight | None
    """The target as it was seen; None where it was not."""
    command: Command
    motion_measured: Array
    """de/dt (k,) of the target's own motion over the last interval between pictures: the
    difference of two errors minus what the camera caused; nan where it was not measured."""
    seconds: float
    """Wall-clock time of the law [s]."""


@final
class Loop:
    """Tracker, features, estimator and controller of a scenario."""

    def __init__(
        self, scenario: Setup, camera: Camera, outline: Array, true: Camera | None = None
    ) -> None:
        """Build the parts.

        Args:
            scenario: Kinds and settings of the parts.
            camera: Intrinsics, as they are believed to be.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m]: level, in
                the order in which an image with the nose to the right shows them, from the top left
                clockwise.
            true: The camera that shows the goal (`believed.goal`), where it differs.

        Raises:
            PartFailed: A part cannot be built.
            ValueError: An argument is none.
        """
        check_setup(scenario, camera, outline)
        self.scenario = scenario
        self.camera = camera
        self.outline = outline
        seed = scenario.run.seed
        tracker = Part("tracker", scenario.tracker)
        features = Part("features", scenario.features)
        estimator = Part("estimator", scenario.estimator)
        controller = Part("controller", scenario.controller)
        built = features.build(outline)
        draws = {name: stream(seed, name) for name in ("tracker", "estimator", "controller")}
        estimates = estimator.build(draws["estimator"])
        followed = tracker.build(draws["tracker"])
        self.tracker: Tracker = tracker.guarded(followed)
        self.features: FeatureSet = features.guarded(built)
        self.features_of_truth: FeatureSet = features.guarded(built, checked=False)
        """The same for records: values of what the camera cannot see need not be finite."""
        self.controller: Controller = controller.guarded(controller.build(draws["controller"]))
        guarded = estimator.guarded(estimates)
        self.estimator: Estimator = guarded
        self.truth_tracker = (
            tracker.guarded(followed) if isinstance(followed, TrackerNeedsTruth) else None
        )
        """The tracker, if it must be given the true position of the target."""
        self._sees_outline = None
        if isinstance(followed, SeesOutline) and _is_tag(scenario, outline):
            self._sees_outline = followed
        self.needs_truth: NeedsTruth | None = guarded if isinstance(estimates, NeedsTruth) else None
        """The estimator, if it must be given the target's true motion."""
        self.forgets: Forgets | None = guarded if isinstance(estimates, Forgets) else None
        """The estimator, if it can take back a measurement."""
        self.is_policy = bool(getattr(scenario.controller, "uses_pictures", False))
        """Whether the controller is given pictures."""
        self.uses_pictures = self.is_policy or bool(getattr(built, "uses_pictures", False))
        """Whether it is, or features are made of pixels: `start` then needs the goal's picture."""
        self._draws = [(each, each.bit_generator.state) for each in draws.values()]
        self.latest: Callable[[], Running | None] = lambda: None
        """The run that was started last, if somebody still has it: it alone has the parts."""
        true = true or camera
        self._pictured = camera if scenario.believed.goal == "computed" else true
        self._seen = true if scenario.believed.goal == "pose" else camera

    def start(
        self,
        frame: Frame,
        region: Region,
        state: State,
        goal: Image | None = None,
        true_motion: TrueMotion | None = None,
        truth: Callable[[int], Truth] | None = None,
    ) -> "Running":
        """Show the target to the tracker in the first picture, and begin the task.

        Args:
            frame: The first picture.
            region: The target's rectangle in it.
            state: Where that is. Where the scenario's target is a tag, the outline its black square
                and the tracker "tag", the square counts that is seen near it.
            goal: The picture (H, W, 3) that the camera takes at the goal, for features made of
                pixels and for policies.
            true_motion: The target's true motion, for an estimator that needs it; only a
                simulation has it.
            truth: Returns the truth of a picture by its number, for a tracker that needs it.

        Returns:
            The running loop; its `step` takes this picture too.

        Raises:
            PartFailed: A part raised an exception.
            ValueError: The region is none, or a setting does not fit the features.
        """
        check_start(frame, self.camera, region, state)
        if self._sees_outline is not None:
            region, state = self._sees_outline.outline(frame, region, state)
        for draws, state_at_first in self._draws:
            draws.bit_generator.state = state_at_first  # each start gives the same numbers
        self.latest = lambda: None
        source = self._goal_source(goal)
        running = Running(self, frame, (region, state), source, true_motion, truth)
        # Weakly: a tracker's process ends with the last one who has the loop, not when the garbage
        # collector finds a circle.
        self.latest = ref(running)
        return running

    def _goal_source(self, picture: Image | None) -> GoalSource:
        """Return what gives the goal of each picture of a run, with the goal's picture (H, W, 3)
        if there is one.

        Raises:
            ValueError: The picture is none of this camera, or the goal moves and it cannot.
        """
        s = self.scenario
        factor = s.believed.depth_factor
        if s.leader.id is None:
            source = Faced(s.goal, self.outline, self._pictured, self._seen, factor)
        else:
            source = Led(s.leader, self.outline, self.camera, factor)
        if picture is None:
            return source
        check_picture("goal", picture, self.camera)
        return Shown(source, CameraImage(picture, self.camera))


def _is_tag(scenario: Setup, outline: Array) -> bool:
    """Return whether the target's outline is the black square of the scenario's tag."""
    target = scenario.target
    return isinstance(target, tag.Config) and bool(
        np.allclose(np.ptp(outline[:, :2], axis=0), target.size, rtol=SAME_SIZE)
    )


@final
class Running:
    """A loop that has been shown its target."""

    def __init__(
        self,
        loop: Loop,
        frame: Frame,
        target: tuple[Region, State],
        goal: GoalSource,
        true_motion: TrueMotion | None,
        truth: Callable[[int], Truth] | None,
    ) -> None:
        """Begin, with the arguments of `Loop.start`; target is the region and its state."""
        self._loop = loop
        scenario = loop.scenario
        region, state = target
        self._true_motion = true_motion
        self._truth = truth
        self._check_settings(frame)
        self._goals = goal
        self._tell(frame)
        try:
            loop.tracker.start(frame, region, state)
        except PartFailed:
            raise
        except ValueError as error:
            raise ValueError(f"first frame: {error}") from None
        # The tracker has not reported yet what it follows: angle and size wait for that.
        self._estimate = Estimate(
            state, unknown_covariance(), 0.0, Status.LOCKED, follows=(False, False)
        )
        self._to_sight = EstimateToSight(
            scenario.sight, loop.camera, region, loop.outline, scenario.believed.depth_factor
        )
        self._period = 1.0 / scenario.camera.rate
        self._shown: float | None = None
        self._carried = np.zeros(4)
        self._follows_known = False
        self.by_corners = False
        """Whether the tracker has reported corners."""
        features = loop.features
        loop.estimator.start(features)
        self._difference = Difference(features)
        first = goal.sight(frame, by_corners=False)
        if first is None:
            raise ValueError(f"leader: no tag {scenario.leader.id} is seen in the first picture")
        self.goal_sight = first
        """How the target shall be seen now."""
        self._scales = features.scales(features.values(self.goal_sight))
        unknown = np.full(len(features.names), np.nan)
        self.decision = Decision(self._estimate, None, Command(np.zeros(6)), unknown, 0.0)
        """The last one; before the first picture was decided on, to stand still."""
        loop.controller.start(
            Task(
                self.goal_sight,
                features,
                loop.estimator,
                loop.camera,
                loop.outline,
                scenario.run.frames_late(self._period),
            )
        )

    def _check_settings(self, first: Frame) -> None:
        """Refuse settings that cannot go together.

        Raises:
            ValueError: The estimator needs the truth and there is none, features made of pixels
                shall do what they cannot, or the first picture lacks the depths that are needed.
        """
        loop = self._loop
        if loop.scenario.sight.uses_depths and first.depth is None:
            raise ValueError(
                'sight: "picture" needs a depth picture: camera.depth = true, or Frame.depth of a '
                "camera of yours"
            )
        if loop.uses_pictures and loop.needs_truth is not None:
            raise ValueError(
                "estimator: the true motion of features made of pixels is not known; choose "
                "another one, such as none"
            )
        if loop.needs_truth is not None and self._true_motion is None:
            raise ValueError(NO_TRUTH)

    def step(self, frame: Frame, posture: Posture) -> Command:
        """Track, and decide how the camera shall move.

        Args:
            frame: The next picture; one that is not fresh is not shown to the tracker.
            posture: What the robot knows of itself at the time of the picture.

        Raises:
            PartFailed: A part raised an exception, or gave something that has no meaning.
            ValueError: The frame is not later than the last one, frame or posture has numbers
                without a meaning, or the loop was started again.
        """
        return self.decide(self.track(frame, posture), posture).command

    def track(self, frame: Frame, posture: Posture) -> Observation:
        """Show the tracker a picture: the first half of `step`, for a robot that goes on meanwhile.

        Args:
            frame: As for `step`.
            posture: As for `step`.

        Returns:
            What `decide` takes.
        """
        began = perf_counter()
        if self._loop.latest() is not self:
            raise ValueError("this run is over: its loop was started again")
        check_frame(frame, self._loop.camera)
        check_posture(posture)
        interval = self._period
        if self._shown is not None:
            interval = elapsed(self._shown, frame.time, self._period)
            self._estimate = self._tracked(frame, posture, interval)
        self._shown = frame.time
        command = None
        if self._loop.is_policy:
            sight = self._sight(frame, self._estimate, posture)
            command = self._loop.controller.command(sight, posture, interval)
        return Observation(frame, self._estimate, interval, perf_counter() - began, command)

    def _tracked(self, frame: Frame, posture: Posture, interval: float) -> Estimate:
        """Return the next estimate. The tracker does not learn of a dropped frame: its last
        estimate stays.
        """
        loop = self._loop
        ego = None
        if loop.scenario.run.ego:
            self._carried += self._to_sight.ego(self._estimate.state, posture.twist, interval)
            ego = self._carried
        if not frame.fresh:
            return self._estimate
        self._carried = np.zeros(4)
        self._tell(frame)
        estimate = loop.tracker.update(frame, ego)
        if not self._follows_known and estimate.status is Status.LOCKED:
            self._follows_known = True
            self.by_corners = estimate.corners is not None
            with Part("features", loop.scenario.features).naming():
                check_followed(loop.features, estimate, self.goal_sight)
        return estimate

    def _tell(self, frame: Frame) -> None:
        """Tell the truth of a picture to a tracker that needs it, if it is known."""
        if self._loop.truth_tracker is not None and self._truth is not None:
            self._loop.truth_tracker.give(self._truth(frame.index))

    def decide(
        self, observation: Observation, posture: Posture, acts: float | None = None
    ) -> Decision:
        """Decide how the camera shall move: the second half of `step`.

        Args:
            observation: What `track` returned last.
            posture: What the robot knows of itself at the time of the picture.
            acts: When the command begins to act [s], for an estimator that needs the truth; None:
                the latency of the scenario after the picture.
        """
        began = perf_counter()
        loop = self._loop
        frame = observation.frame
        if loop.needs_truth is not None and self._true_motion is not None:
            if acts is None:
                acts = frame.time + loop.scenario.run.frames_late(self._period) * self._period
            motion = self._true_motion(frame.index, acts, acts + observation.interval)
            loop.needs_truth.give(motion / self._scales)
        goal = self._goals.sight(frame, by_corners=self.by_corners)
        self.goal_sight = goal or self.goal_sight
        # Where the goal is not known the error is not, as where the target is not seen.
        sight = None if goal is None else self._sight(frame, observation.estimate, posture)
        if frame.fresh and sight is None and loop.forgets is not None:
            loop.forgets.forget()
        command = observation.command or loop.controller.command(
            sight, posture, observation.interval
        )
        with Part("controller", loop.scenario.controller).naming():
            check_same_features(command, loop.features.names)
        seconds = perf_counter() - began
        motion = self._measured(command, sight, observation.interval)
        self.decision = Decision(observation.estimate, sight, command, motion, seconds)
        return self.decision

    def _sight(self, frame: Frame, estimate: Estimate, posture: Posture) -> Sight | None:
        goal = self.goal_sight
        if not frame.fresh:
            return None
        if goal.picture is None:
            return self._to_sight.see(estimate, posture, goal, frame.depth)
        picture = CameraImage(frame.image, self._loop.camera)
        return replace(goal, picture=picture, goal=goal)

    def _measured(self, command: Command, sight: Sight | None, interval: float) -> Array:
        trace = command.trace
        if trace is None or sight is None:
            self._difference.forget()
            return np.full(len(self._loop.features.names), np.nan)
        found, fresh = self._difference.measure(trace.error / trace.scales, trace.own, interval)
        return np.where(fresh, trace.scales * found, np.nan)
