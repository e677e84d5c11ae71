"""The closed loop without a world: pictures and postures in, camera twists out.

It serves a simulated or a real camera and robot alike:

    loop = Loop(scenario, camera, outline)
    loop.start(frame, region, state)         # the first picture, and the target in it
    command = loop.step(frame, posture)      # for each picture, the first included
"""

from __future__ import annotations

from dataclasses import replace
from math import radians
from time import perf_counter
from typing import Any

import numpy as np

from servo.estimators.difference import Difference
from servo.loop.part_checks import check_built, check_command, check_estimate
from servo.loop.part_failed import PartFailed, part_failed
from servo.parts import Controller, Estimator, FeatureSet, NeedsTruth, Task
from servo.scenario.load import Scenario
from servo.sight.estimate_to_sight import EstimateToSight
from servo.types import CameraImage, Command, Sight
from sim.placement import size_above
from sim.types import Array, Camera, Frame, Image, Posture
from tracking.types import Estimate, Region, State, Status, Tracker, unknown_covariance

NO_TRUTH = (
    "this estimator needs the true motion of the target (motion_true), which only a simulation "
    "knows; with a real camera choose another one, such as kalman_cv"
)


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one part of a run: what one part draws never shifts another's."""
    return np.random.default_rng([seed, *name.encode()])


class Loop:
    """Tracker, features, estimator and controller of a scenario."""

    estimate: Estimate
    """What the tracker reported last."""
    sight: Sight | None
    """The target as it was seen in the last frame; None where it was not."""
    goal_sight: Sight
    """How the target shall be seen now."""
    motion_measured: Array
    """de/dt (k,) of the target's own motion over the last frame interval: the difference of two
    errors minus what the camera caused; nan where it was not measured."""
    seconds: tuple[float, float]
    """Wall-clock time of tracker and law in the last step [s]."""

    def __init__(self, scenario: Scenario, camera: Camera, outline: Array) -> None:
        """Build the parts.

        Args:
            scenario: Which, and with which settings.
            camera: Intrinsics.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m]: level, in
                the order in which an image with the nose to the right shows them, from the top left
                clockwise.
        """
        self._scenario, self._camera, self._outline = scenario, camera, outline
        self._period = 1.0 / scenario.camera.rate
        seed, goal = scenario.run.seed, scenario.goal

        def built(part: str, given: Any) -> Any:
            config = getattr(scenario, part)
            return check_built(part, config, config.build(given))

        self.tracker: Tracker = built("tracker", stream(seed, "tracker"))
        self.features: FeatureSet = built("features", outline)
        self.controller: Controller = built("controller", stream(seed, "controller"))
        self._estimator: Estimator = built("estimator", stream(seed, "estimator"))
        self.parts: dict[str, tuple[Any, ...]] = {
            "tracker": (scenario.tracker, self.tracker),
            "features": (scenario.features, self.features),
            "estimator": (scenario.estimator, self._estimator),
            "controller": (scenario.controller, self.controller),
        }
        """Each part with a kind: its `Config`, and what that built."""
        self.uses_pictures = bool(getattr(self.features, "uses_pictures", False))
        """Whether the features are made of pixels: `start` then needs a picture of the goal."""
        self.goal = np.array([camera.width / 2 + goal.x, camera.height / 2 + goal.y])
        """Where the target's centre shall be (2,) [px]."""
        self.goal_theta = radians(goal.angle_deg)
        """Direction in which the target's nose shall point [rad]."""
        self._sizes: dict[float, float] = {}

    @property
    def needs_truth(self) -> bool:
        """Whether the estimator knows the true motion, which `step` must then be given."""
        return isinstance(self._estimator, NeedsTruth)

    def goal_size(self, time: float) -> float:
        """Size that the target shall have at a time [s], in px of the image a metre."""
        depth = self._scenario.goal.depth_at(time)
        if self._camera.distortion is None:
            return self._camera.focal / depth
        if depth not in self._sizes:
            above = self._camera, self._outline, self.goal, self.goal_theta, depth
            self._sizes = {depth: size_above(*above)}
        return self._sizes[depth]

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
        self._to_sight = EstimateToSight(scenario.sight, self._camera, region, self._outline)
        self._carried = np.zeros(4)
        self._is_first, self._is_checked = True, False
        self._estimator.start(self.features)
        self._difference = Difference(self.features)
        self.goal_sight = self._goal_sight(0.0)
        self._scales = self.features.scales(self.features.values(self.goal_sight))
        self.controller.start(
            Task(
                self.goal_sight, self.features, self._estimator, self._camera, self._outline,
                scenario.run.latency,
            )
        )  # fmt: skip

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
            ValueError: The estimator needs the truth, which is not given.
        """
        if isinstance(self._estimator, NeedsTruth):
            if motion_true is None:
                raise ValueError(NO_TRUTH)
            self._estimator.give(motion_true / self._scales)
        try:
            return self._step(frame, posture)
        except BaseException as error:
            failed = part_failed(error, self.parts)
            if failed is None:
                raise
            raise failed from error

    def _step(self, frame: Frame, posture: Posture) -> Command:
        began = perf_counter()
        if not self._is_first:
            self._track(frame, posture)
        self._is_first = False
        tracked = perf_counter()
        if self._scenario.goal.depth_to is not None:
            self.goal_sight = self._goal_sight(frame.time)
            self.controller.aim(self.goal_sight)
        self.sight = self._see(frame, posture) if frame.fresh else None
        asked = self.controller.command(self.sight, posture, self._period)
        command = check_command(asked, self.parts, self.sight)
        self.seconds = tracked - began, perf_counter() - tracked
        self.motion_measured = self._measured(command)
        return command

    def _see(self, frame: Frame, posture: Posture) -> Sight | None:
        goal = self.goal_sight
        if self._goal_picture is None:
            return self._to_sight.see(self.estimate, posture, goal)
        return replace(goal, picture=CameraImage(frame.image, self._camera), goal=goal)

    def _goal_sight(self, time: float) -> Sight:
        length, width = np.ptp(self._outline[:, :2], axis=0) * self.goal_size(time)
        x, y = self.goal.tolist()
        sight = self._to_sight.goal(State(x, y, self.goal_theta), Region(length, width))
        return sight if self._goal_picture is None else replace(sight, picture=self._goal_picture)

    def _track(self, frame: Frame, posture: Posture) -> None:
        """The next estimate; the tracker does not learn of a dropped frame, its last one stays."""
        ego = None
        if self._scenario.run.ego:
            self._carried += self._to_sight.ego(self.estimate.state, posture.twist, self._period)
            ego = self._carried
        if not frame.fresh:
            return
        self._carried = np.zeros(4)
        self.estimate = check_estimate(self.tracker.update(frame, ego), self._scenario.tracker)
        if not self._is_checked and self.estimate.status is Status.LOCKED:
            self._check_known()

    def _check_known(self) -> None:
        """Refuse features of which the tracker, which has reported what it follows, gives none."""
        self._is_checked = True
        angle, size = (has or self.estimate.corners is not None for has in self.estimate.follows)
        sight = replace(self.goal_sight, angle_known=angle, size_known=size)
        if not (angle and size) and not self.features.known(sight).any():
            missing = " nor ".join(["angle"] * (not angle) + ["size"] * (not size))
            what = f"the tracker follows no {missing}, without which none of them is known"
            raise PartFailed.by("features", self._scenario.features, what)

    def _measured(self, command: Command) -> Array:
        unknown, trace = np.full(len(self.features.names), np.nan), command.trace
        if trace is None or self.sight is None:
            self._difference.forget()
            return unknown
        errors = trace.error / trace.scales
        found, fresh = self._difference.measure(errors, trace.own, self._period)
        return np.where(fresh, trace.scales * found, unknown)
