"""The closed loop without a world: pictures and postures in, camera twists out.

It serves a simulated or a real camera and robot alike:

    loop = Loop(scenario, camera, outline)
    loop.start(frame, region, state)         # the first picture, and the target in it
    command = loop.step(frame, posture)      # for each picture, the first included
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from servo.estimators.difference import Difference
from servo.loop.goal import Goal
from servo.loop.part_checks import check_built, check_command, check_estimate, check_known
from servo.loop.part_failed import parts_named
from servo.loop.posture_record import elapsed
from servo.parts import Controller, Estimator, FeatureSet, Forgets, NeedsTruth, Task
from servo.scenario.draws import stream
from servo.scenario.load import Scenario
from servo.sight.estimate_to_sight import EstimateToSight
from servo.types import CameraImage, Command, Sight
from sim.types import Array, Camera, Frame, Image, Posture
from tracking.types import Estimate, Region, State, Status, Tracker, unknown_covariance

NO_TRUTH = (
    "this estimator needs the true motion of the target (motion_true), which only a simulation "
    "knows; with a real camera choose another one, such as kalman_cv"
)


class Loop:
    """Tracker, features, estimator and controller of a scenario."""

    estimate: Estimate
    """What the tracker reported last."""
    sight: Sight | None
    """The target as it was seen in the last frame; None where it was not."""
    goal_sight: Sight
    """How the target shall be seen now."""
    _shown: Frame | None
    motion_measured: Array
    """de/dt (k,) of the target's own motion over the last frame interval: the difference of two
    errors minus what the camera caused; nan where it was not measured."""
    interval: float
    """Between the last two pictures that the tracker was shown [s]."""
    seconds: tuple[float, float]
    """Wall-clock time of tracker and law in the last step [s]."""

    def __init__(
        self, scenario: Scenario, camera: Camera, outline: Array, true: Camera | None = None
    ) -> None:
        """Build the parts.

        Args:
            scenario: Which, and with which settings.
            camera: Intrinsics, as they are believed to be.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m]: level, in
                the order in which an image with the nose to the right shows them, from the top left
                clockwise.
            true: Where they differ, those of the camera that shows the goal (`believed.goal`).
        """
        self._scenario = scenario
        self._camera = camera
        self._outline = outline
        self._period = 1.0 / scenario.camera.rate
        seed = scenario.run.seed
        believed = scenario.believed

        self.parts: dict[str, tuple[Any, ...]] = {}
        """Each part with a kind: its `Config`, and what that built."""

        def built(part: str, given: Any) -> Any:
            config = getattr(scenario, part)
            made = check_built(part, config, config.build(given))
            self.parts[part] = config, made
            return made

        self.tracker: Tracker = built("tracker", stream(seed, "tracker"))
        self.features: FeatureSet = built("features", outline)
        self.controller: Controller = built("controller", stream(seed, "controller"))
        self._estimator: Estimator = built("estimator", stream(seed, "estimator"))
        self.uses_pictures = bool(getattr(self.features, "uses_pictures", False))
        """Whether the features are made of pixels: `start` then needs a picture of the goal."""
        true = true or camera
        pictured = camera if believed.goal == "computed" else true
        seen = true if believed.goal == "pose" else camera
        self.goal = Goal(scenario.goal, outline, pictured, seen, believed.depth_factor)
        """How the target shall be seen."""

    @property
    def needs_truth(self) -> bool:
        """Whether `step` must be given the true motion, for the estimator."""
        return isinstance(self._estimator, NeedsTruth)

    def start(self, frame: Frame, region: Region, state: State, goal: Image | None = None) -> None:
        """Show the target to the tracker in the first picture, and begin the task.

        Args:
            frame: The first picture.
            region: The target's rectangle in it.
            state: Where that is.
            goal: The picture (H, W, 3) that the camera takes at the goal, for features made of
                pixels.

        Raises:
            ValueError: The region is none, or a setting does not fit the features.
        """
        scenario = self._scenario
        self._check_pictures()
        self._goal_picture = None if goal is None else CameraImage(goal, self._camera)
        try:
            self.tracker.start(frame, region, state)
        except ValueError as error:
            raise ValueError(f"first frame: {error}") from None
        # The tracker has not reported yet what it follows: angle and size wait for that.
        self.estimate = Estimate(
            state, unknown_covariance(), 0.0, Status.LOCKED, follows=(False, False)
        )
        self._to_sight = EstimateToSight(
            scenario.sight, self._camera, region, self._outline, scenario.believed.depth_factor
        )
        self._carried = np.zeros(4)
        self._shown = None
        self._is_checked = False
        self.sight = None
        self.interval = self._period
        self.seconds = (0.0, 0.0)
        self.motion_measured = np.full(len(self.features.names), np.nan)
        self._estimator.start(self.features)
        self._difference = Difference(self.features)
        self.goal_sight = self._goal_sight(0.0)
        self._scales = self.features.scales(self.features.values(self.goal_sight))
        self.controller.start(
            Task(
                self.goal_sight,
                self.features,
                self._estimator,
                self._camera,
                self._outline,
                scenario.run.latency,
            )
        )

    def _check_pictures(self) -> None:
        """Refuse what features made of pixels cannot do.

        Raises:
            ValueError: A setting does not fit them.
        """
        if not self.uses_pictures:
            return
        if self.needs_truth:
            raise ValueError(
                "estimator: the true motion of features made of pixels is not known; choose "
                "another one, such as none"
            )
        if self._scenario.goal.depth_to is not None:
            raise ValueError(
                "goal.depth_to: features made of pixels are compared with one picture, taken at "
                "goal.depth, so their goal cannot move"
            )

    def step(self, frame: Frame, posture: Posture, motion_true: Array | None = None) -> Command:
        """Track, and decide how the camera shall move.

        Args:
            frame: The next picture; one that is not fresh is not shown to the tracker.
            posture: What the robot knows of itself at the time of the picture.
            motion_true: de/dt (k,) of the target's own motion while this command acts, for an
                estimator that needs the truth (`needs_truth`).

        Raises:
            PartFailed: A part raised an exception, or gave something that has no meaning.
            ValueError: The estimator needs the truth, or the frame is not later than the last one.
        """
        self.track(frame, posture)
        return self.decide(posture, motion_true)

    def track(self, frame: Frame, posture: Posture) -> None:
        """The first half of `step`: show the tracker a picture. `decide` must follow."""
        began = perf_counter()
        self._tracked = self.estimate
        if self._shown is not None:
            self.interval = elapsed(self._shown.time, frame.time, self._period)
            with parts_named(self.parts):
                self._track(frame, posture)
        self._shown = frame
        self.seconds = perf_counter() - began, 0.0

    def decide(self, posture: Posture, motion_true: Array | None = None) -> Command:
        """The second half of `step`, as soon as the estimate is there."""
        began = perf_counter()
        if isinstance(self._estimator, NeedsTruth):
            if motion_true is None:
                raise ValueError(NO_TRUTH)
            self._estimator.give(motion_true / self._scales)
        with parts_named(self.parts):
            command = self._decide(self._shown, posture)
        self.seconds = self.seconds[0], perf_counter() - began
        self.motion_measured = self._measured(command)
        return command

    def _decide(self, frame: Frame | None, posture: Posture) -> Command:
        if frame is None:
            raise ValueError("decide: expected a picture by track first, got none")
        self.estimate = self._tracked
        if self._scenario.goal.depth_to is not None:
            self.goal_sight = self._goal_sight(frame.time)
            self.controller.aim(self.goal_sight)
        self.sight = self._see(frame, posture) if frame.fresh else None
        if frame.fresh and self.sight is None and isinstance(self._estimator, Forgets):
            self._estimator.forget()
        asked = self.controller.command(self.sight, posture, self.interval)
        return check_command(asked, self.parts, self.sight)

    def _see(self, frame: Frame, posture: Posture) -> Sight | None:
        goal = self.goal_sight
        if self._goal_picture is None:
            return self._to_sight.see(self.estimate, posture, goal)
        return replace(goal, picture=CameraImage(frame.image, self._camera), goal=goal)

    def _goal_sight(self, time: float) -> Sight:
        sight = self.goal.sight(time)
        return sight if self._goal_picture is None else replace(sight, picture=self._goal_picture)

    def _track(self, frame: Frame, posture: Posture) -> None:
        """The next estimate; the tracker does not learn of a dropped frame, its last one stays."""
        ego = None
        if self._scenario.run.ego:
            self._carried += self._to_sight.ego(self.estimate.state, posture.twist, self.interval)
            ego = self._carried
        if not frame.fresh:
            return
        self._carried = np.zeros(4)
        self._tracked = check_estimate(self.tracker.update(frame, ego), self._scenario.tracker)
        if not self._is_checked and self._tracked.status is Status.LOCKED:
            self._is_checked = True
            given = self._scenario.features, self.features
            check_known(*given, self._tracked, self.goal_sight)

    def _measured(self, command: Command) -> Array:
        unknown = np.full(len(self.features.names), np.nan)
        trace = command.trace
        if trace is None or self.sight is None:
            self._difference.forget()
            return unknown
        errors = trace.error / trace.scales
        found, fresh = self._difference.measure(errors, trace.own, self.interval)
        return np.where(fresh, trace.scales * found, unknown)
