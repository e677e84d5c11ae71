"""Closed loop of tracker and control law without a simulated world: pictures and robot postures in,
camera twists out.

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

from servo.goals.faced import Faced
from servo.goals.led import Led
from servo.goals.shown import Shown
from servo.loop.inputs import check_frame, check_picture, check_posture, check_setup, check_start
from servo.loop.law import Law
from servo.loop.perception import Perception
from servo.loop.posture_record import elapsed
from servo.loop.settings import Setup, stream
from servo.parts import FeatureSet, GoalSource
from servo.types import CameraImage, Command, Sight
from sim.channels import Channel, Channels, View
from sim.types import Array, Camera, Frame, Image, Posture, Truth
from tracking.types import Estimate, Region, State


class TrueMotion(Protocol):
    """Function that returns the rate at which the target's own motion changes the features in a
    time interval; only a simulation has it.
    """

    def __call__(self, picture: int, begin: float, end: float) -> Array:
        """Return the mean rate (k,), in the units of the k features per second, at which the
        target's own motion changes them between two times of the run.

        Args:
            picture: Number of a picture, from 0. The camera is assumed to have, at the beginning of
                the interval, the pose relative to the target that it had in this picture, and to
                stand still during the interval.
            begin: Beginning of the interval [s].
            end: End of the interval [s].
        """
        ...


@dataclass(frozen=True, slots=True)
class Observation:
    """What the tracker reports on a frame: its estimate (the previous one, if the camera delivered
    no picture), the time since the previous frame [s], and the wall-clock time that the tracker
    took [s]; for a policy, a controller that uses pictures, also its command, whose time is
    included.
    """

    frame: Frame
    estimate: Estimate
    interval: float
    """Time since the frame of the previous call of `track` [s]; in the first call, the frame
    interval."""
    seconds: float
    """Wall-clock time of the tracker, and of a policy if there is one [s]."""
    command: Command | None = None
    """Command of a controller that uses pictures (a policy), whose time counts as the tracker's;
    None for other controllers."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What the control law returns for a picture: the command, the estimate and the view of the
    target from which the command was computed, the measured rate (k,) at which the target's own
    motion changed the k features, in their units per second, and the law's wall-clock time [s].
    """

    estimate: Estimate
    """The tracker's estimate."""
    sight: Sight | None
    """View of the target; None if the target was not seen, or the goal was not known."""
    command: Command
    motion_measured: Array
    """de/dt (k,) caused by the target's own motion since the previous picture: the difference of
    the two errors over their interval, minus the camera's part; nan for features that were not
    measured in both."""
    seconds: float
    """Wall-clock time of the law [s]."""


@final
class Loop:
    """Closed loop of a scenario: tracker, feature set, estimator and controller, without a
    simulated world. `start` begins a run of it, which takes pictures and robot postures and returns
    camera twists.
    """

    def __init__(
        self, scenario: Setup, camera: Camera, outline: Array, true: Camera | None = None
    ) -> None:
        """Build and check tracker, feature set, estimator and controller.

        Args:
            scenario: Kinds and settings of the components.
            camera: Intrinsics of the camera, as the robot believes them.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m], all at one
                height. Seen from above with the target's nose to the right, the first is at the top
                left, and the others follow clockwise.
            true: The true camera, for a goal that is computed with it (`believed.goal`); None:
                `camera`.

        Raises:
            PartFailed: A component's code raised an exception, or a component breaks its contract.
            ValueError: An argument has the wrong type or value, or a component's settings refused
                themselves.
        """
        check_setup(scenario, camera, outline)
        self.scenario = scenario
        self.camera = camera
        self.outline = outline
        seed = scenario.run.seed
        draws = {name: stream(seed, name) for name in ("tracker", "estimator", "controller")}
        self.law = Law(scenario, camera, outline, draws)
        self.perception = Perception(scenario, camera, outline, draws["tracker"])
        self._draws = [(each, each.bit_generator.state) for each in draws.values()]
        self.latest: Callable[[], Running | None] = lambda: None
        """Function that returns the run that was started last, the only one that may use the
        components; None if there is none or it no longer exists."""
        true = true or camera
        self._pictured = camera if scenario.believed.goal == "computed" else true
        self._seen = true if scenario.believed.goal == "pose" else camera

    @property
    def features(self) -> FeatureSet:
        """Set of visual features that the control law drives to their goal."""
        return self.law.features

    def start(
        self,
        frame: Frame,
        region: Region,
        state: State,
        goal: Image | None = None,
        true_motion: TrueMotion | None = None,
        truth: Callable[[int], Truth] | None = None,
    ) -> "Running":
        """Start the tracker with the target in the first picture, and return a run of this loop. An
        earlier run is then over: it uses the same components.

        Args:
            frame: The first picture.
            region: Width and height of the target's rectangle at scale 1 [px].
            state: Position [px], angle [rad] and scale of the target in that picture. If the target
                is a tag whose outline is its black square, and the tracker is "tag", a square that
                is detected near the given one replaces region and state.
            goal: The camera's picture (H, W, 3) at the goal, for features made of pixels and for
                policies (controllers that use pictures); None if neither is used.
            true_motion: Function that returns the target's true motion, for an estimator that needs
                it; only a simulation has it.
            truth: Function that returns the true poses at a picture by the picture's number, for
                components that need them.

        Returns:
            The run; its `step` takes this picture first.

        Raises:
            PartFailed: A component raised an exception, or returned an invalid value.
            ValueError: An argument has the wrong type or size, the tracker refuses the region, a
                setting does not fit the features, data that a component needs is missing, the
                leader's tag (which the goal is relative to) is not seen, or the goal moves although
                there is a picture of it.
        """
        check_start(frame, self.camera, region, state)
        for draws, state_at_first in self._draws:
            draws.bit_generator.state = state_at_first  # each start gives the same numbers
        self.latest = lambda: None
        running = Running(self, self._goal_source(goal), true_motion, truth)
        running.begin(frame, region, state)
        # Weakly: a tracker's process ends with the last one who has the loop, not when the garbage
        # collector finds a circle.
        self.latest = ref(running)
        return running

    def _goal_source(self, picture: Image | None) -> GoalSource:
        """Return the goal source of a run, the object that gives the desired view of the target for
        each picture. With a picture (H, W, 3) at the goal, it has that picture too.

        Raises:
            ValueError: The picture does not fit the camera, or the goal moves although there is a
                picture of it.
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


@final
class Running:
    """A run of a `Loop`, which `Loop.start` returns: `step` takes each picture with the robot's
    posture and returns the command, a camera twist.
    """

    def __init__(
        self,
        loop: Loop,
        goals: GoalSource,
        true_motion: TrueMotion | None,
        truth: Callable[[int], Truth] | None,
    ) -> None:
        """Store a loop, and the sources of its goal, true motion and true poses, which `Loop.start`
        describes.
        """
        self._loop = loop
        self._perception = loop.perception
        self._law = loop.law
        self._goals = goals
        self._true_motion = true_motion
        self._truth = truth
        self._period = 1.0 / loop.scenario.camera.rate
        self._frames_late = loop.scenario.run.frames_late(self._period)
        self._shown: float | None = None

    def begin(self, frame: Frame, region: Region, state: State) -> None:
        """Start tracker and control law with the target in the first picture, and store the goal at
        that time and, as the last decision, a command to stand still. Only `Loop.start` calls this
        method; its documentation describes arguments and exceptions.
        """
        self._law.check(depths=frame.depth is not None, true_motion=self._true_motion is not None)
        self._estimate = self._perception.start(
            frame, region, state, self._truth_at(frame, self._perception.needs)
        )
        first = self._goals.sight(frame, by_corners=False)
        if first is None:
            number = self._loop.scenario.leader.id
            raise ValueError(
                f"leader: no tag {number} is seen in the first picture: move the tag into view, or "
                "correct leader.id"
            )
        self.goal_sight = first
        """The desired view of the target for the last picture for which the goal was known."""
        self._law.start(first, self._frames_late)
        unknown = np.full(len(self._law.features.names), np.nan)
        self.decision = Decision(self._estimate, None, Command(np.zeros(6)), unknown, 0.0)
        """The last decision; before the first one, a command to stand still."""

    @property
    def by_corners(self) -> bool:
        """Whether the tracker's first estimate with status LOCKED in this run had the target's
        corners; False before that estimate.
        """
        return self._perception.by_corners

    def step(self, frame: Frame, posture: Posture) -> Command:
        """Return the command, a camera twist, after the next picture. It calls `track`, then
        `decide`.

        Args:
            frame: The next picture; in the first call, the one that `Loop.start` was given. If its
                `fresh` is False, because the camera delivered no new picture, the tracker is not
                called, and the law takes the target as not seen.
            posture: Camera pose, twist and joints of the robot at the time of the picture.

        Raises:
            PartFailed: A component raised an exception, or returned an invalid value; or no feature
                can be measured from what the tracker follows.
            ValueError: The frame is not later than that of the previous call, frame or posture has
                a wrong type, shape or number, or the loop was started again.
            Mistake: The goal is tilted, and the tracker reports no corners.
        """
        return self.decide(self.track(frame, posture), posture).command

    def track(self, frame: Frame, posture: Posture) -> Observation:
        """Run the tracker on a picture, and return its observation for `decide`: the first half of
        `step`, for a robot that moves on while the tracker works.

        Args:
            frame: The next picture; in the first call, the one that `Loop.start` was given, for
                which the state given there is the estimate. If its `fresh` is False, because the
                camera delivered no new picture, the tracker is not called, and the previous
                estimate is used.
            posture: Camera pose, twist and joints of the robot at the time of the picture.

        Raises:
            PartFailed: The tracker or a policy raised an exception, or returned an invalid value;
                or no feature can be measured from what the tracker follows.
            ValueError: The frame is not later than that of the previous call, frame or posture has
                a wrong type, shape or number, or the loop was started again.
            Mistake: The goal is tilted, and the tracker reports no corners.
        """
        began = perf_counter()
        if self._loop.latest() is not self:
            raise ValueError(
                "this run is over, because its loop was started again: use the newest result of "
                "Loop.start"
            )
        check_frame(frame, self._loop.camera)
        check_posture(posture)
        interval = self._period
        if self._shown is not None:
            interval = elapsed(self._shown, frame.time, self._period)
            # The first picture was given to `start`: tracking begins with the second.
            had_reported = self._perception.has_reported
            self._estimate = self._perception.track(
                frame, posture, interval, self._truth_at(frame, self._perception.needs)
            )
            if self._perception.has_reported and not had_reported:
                self._law.check_followed(self._estimate)
        self._shown = frame.time
        command = None
        if self._law.is_policy:
            sight = self._sight(frame, self._estimate, posture)
            command = self._law.command(sight, posture, interval, self._view(frame, sight, None))
        return Observation(frame, self._estimate, interval, perf_counter() - began, command)

    def decide(
        self, observation: Observation, posture: Posture, acts: float | None = None
    ) -> Decision:
        """Compute the law's command from an observation, store the result as `decision`, and return
        it: the second half of `step`. A policy (a controller that uses pictures) has computed its
        command already, in `track`.

        Args:
            observation: What the last call of `track` returned.
            posture: Camera pose, twist and joints of the robot at the time of the picture.
            acts: Time of the run at which the command begins to act [s], for an estimator that
                needs the target's true motion; None: the scenario's latency after the picture.

        Raises:
            PartFailed: A component raised an exception, or returned an invalid value.
        """
        began = perf_counter()
        frame = observation.frame
        interval = observation.interval
        motion = self._motion_while(frame, interval, acts)
        goal = self._goals.sight(frame, by_corners=self.by_corners)
        self.goal_sight = goal or self.goal_sight
        # Without a goal there is no error, as if the target were not seen.
        sight = None if goal is None else self._sight(frame, observation.estimate, posture)
        # A policy has decided in `track` already, where its time counts.
        command = observation.command or self._law.command(
            sight, posture, interval, self._view(frame, sight, motion)
        )
        seconds = perf_counter() - began
        measured = self._law.motion_measured(command, sight, interval)
        self.decision = Decision(observation.estimate, sight, command, measured, seconds)
        return self.decision

    def _sight(self, frame: Frame, estimate: Estimate, posture: Posture) -> Sight | None:
        """Return the view of the target in a picture; None if the target is not seen. If the law
        uses pictures, return the desired view with the current picture in place of the goal's, or
        None if the camera delivered no new picture.
        """
        goal = self.goal_sight
        if not frame.fresh:
            return None
        if not self._law.uses_pictures:
            return self._perception.sight(frame, estimate, posture, goal)
        picture = CameraImage(frame.image, self._loop.camera)
        return replace(goal, picture=picture, goal=goal)

    def _motion_while(self, frame: Frame, interval: float, acts: float | None) -> Array | None:
        """Return the mean true de/dt (k,) that the target's own motion causes while the next
        command acts, divided by the features' scales [1/s]; None if no component needs it.

        Args:
            frame: The picture.
            interval: Time since the previous frame, and assumed duration of the command [s].
            acts: Time of the run at which the command begins to act [s]; None: the scenario's
                latency after the picture.
        """
        if Channel.TRUE_MOTION not in self._law.needs or self._true_motion is None:
            return None
        begin = frame.time + self._frames_late * self._period if acts is None else acts
        return self._true_motion(frame.index, begin, begin + interval) / self._law.scales

    def _truth_at(self, frame: Frame, needs: Channels) -> Truth | None:
        """Return the true poses at a picture; None if none of the given channels needs them, or
        they are not available.
        """
        if Channel.TRUTH not in needs or self._truth is None:
            return None
        return self._truth(frame.index)

    def _view(
        self, frame: Frame, sight: Sight | None, motion: Array | None
    ) -> Callable[[Channels], View]:
        """Return a function that takes the channels that a component needs, and returns a `View`
        with their data at the time of a frame: picture, depth picture, true poses, true motion, and
        whether the target is seen.
        """

        def view(needs: Channels) -> View:
            truth = self._truth_at(frame, needs)
            seen = sight is not None if frame.fresh else None
            return View.of(frame, needs, truth=truth, true_motion=motion, seen=seen)

        return view
