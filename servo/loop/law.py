"""Runs a scenario's control law (feature set, estimator and controller): it takes what the camera
sees of the target (`Sight`), and returns the camera twist.
"""

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from servo.contracts import BrokenContract, check_followed, check_same_features
from servo.loop.part_failures import Part
from servo.loop.settings import Setup
from servo.mistake import Mistake
from servo.parts import Controller, Estimator, FeatureSet, Task
from servo.sight.difference import Difference
from servo.types import Command, Sight
from sim.channels import Channel, Channels, Sees, View, needs_of
from sim.types import Array, Camera, Posture
from tracking.types import Estimate

NO_TRUTH = (
    "this kind needs the true motion of the target (true_motion), which only a simulation knows: "
    "with a real camera choose another kind, such as kalman_cv"
)
OF_PICTURES = (
    "this kind needs the target's true motion, which is not known where features or controller use "
    "the pictures themselves: choose another kind, such as the estimator none"
)


@final
class Law:
    """The control law of a scenario: its feature set, estimator and controller, built, and checked
    against their contracts. After `start`, `command` computes a camera twist from the target as it
    is seen in each picture.
    """

    def __init__(
        self,
        scenario: Setup,
        camera: Camera,
        outline: Array,
        draws: Mapping[str, np.random.Generator],
    ) -> None:
        """Build feature set, estimator and controller.

        Args:
            scenario: Kinds and settings of the components.
            camera: Intrinsics of the camera, as the robot believes them.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            draws: Random generators by name: "estimator" and "controller".

        Raises:
            PartFailed: A component's code raised an exception, or a component breaks its contract.
            Mistake: A component's settings refused themselves with a ValueError.
        """
        self._scenario = scenario
        self._camera = camera
        self._outline = outline
        features = Part("features", scenario.features)
        estimator = Part("estimator", scenario.estimator)
        controller = Part("controller", scenario.controller)
        built = (
            features.build(outline),
            estimator.build(draws["estimator"]),
            controller.build(draws["controller"]),
        )
        self._features = features
        self._controller = controller
        self._names = built[0].names
        self.features: FeatureSet = features.guarded(built[0])
        self.features_of_truth: FeatureSet = features.guarded(built[0], checked=False)
        """The feature set without checks, for records: features of targets that the camera cannot
        see may be infinite or nan."""
        self.estimator: Estimator = estimator.guarded(built[1])
        self.controller: Controller = controller.guarded(built[2])
        self._parts = parts = features, estimator, controller
        self._viewers = [
            (part.guarded(one), needs_of(part.config))
            for part, one in zip(parts, built, strict=True)
            if isinstance(one, Sees)
        ]
        self.needs = frozenset[Channel]().union(*(needs_of(part.config) for part in parts))
        """The channels that the components declare."""
        self.is_policy = Channel.PICTURE in needs_of(scenario.controller)
        """Whether the controller uses pictures."""

    @property
    def uses_pictures(self) -> bool:
        """Whether the controller or the feature set acts on the camera's pictures themselves, and
        not on a view of the target.
        """
        return self.is_policy or Channel.PICTURE in needs_of(self._features.config)

    def check(self, *, depths: bool, true_motion: bool) -> None:
        """Check that depth pictures and the target's true motion are available if the settings of
        sight, tracker, feature set, estimator or controller need them.

        Args:
            depths: Whether the camera delivers depth pictures.
            true_motion: Whether the target's true motion is available, as in a simulation.

        Raises:
            ValueError: Depth pictures or the true motion are needed and missing, or a component
                needs the true motion although features or controller use pictures.
        """
        if Channel.DEPTH in self._scenario.sight.needs and not depths:
            raise ValueError(
                'sight: plane or depth = "picture" needs a depth picture, and there is none: set '
                "camera.depth = true, or give Frame.depth with a camera of your own"
            )
        if Channel.DEPTH in self._scenario.needs and not depths:
            raise ValueError(
                "the Config of a component needs DEPTH, the depth picture, and there is none: set "
                "camera.depth = true, or give Frame.depth with a camera of your own"
            )
        for part in self._parts:
            if Channel.TRUE_MOTION not in needs_of(part.config):
                continue
            if self.uses_pictures:
                raise ValueError(f"{part.place}: {OF_PICTURES}")
            if not true_motion:
                raise ValueError(f"{part.place}: {NO_TRUTH}")

    def start(self, goal: Sight, frames_late: float) -> None:
        """Begin a run: start the estimator, then the controller, with the goal.

        Args:
            goal: The desired view of the target at the beginning of the run.
            frames_late: Delay from an estimate to the effect of its command [frame intervals].

        Raises:
            ValueError: A setting does not fit the features.
            PartFailed: A component raised another exception, or returned an invalid value.
        """
        self.estimator.start(self.features)
        self._difference = Difference(self.features)
        self._goal = goal
        self.scales = self.features.scales(self.features.values(goal))
        """The divisors (k,) of the estimator's features: `FeatureSet.scales` at the goal."""
        self.controller.start(
            Task(goal, self.features, self.estimator, self._camera, self._outline, frames_late)
        )

    def check_followed(self, estimate: Estimate) -> None:
        """Check that at least one feature can be measured from what the tracker follows (angle,
        size, corners). `start` must have been called.

        Args:
            estimate: The tracker's first estimate with a visible target; `follows` and `corners`
                say what it follows.

        Raises:
            PartFailed: No feature can be measured.
            Mistake: The goal is tilted, and the tracker does not report the corners that show it.
        """
        is_blind = estimate.corners is None and not self.uses_pictures
        if self._scenario.goal.tilt_deg and is_blind:
            raise Mistake(
                "goal.tilt_deg: this tracker reports a rectangle, which does not show a tilt: use "
                "a tracker that reports corners, or leave goal.tilt_deg out"
            )
        with self._features.naming():
            check_followed(self.features, estimate, self._goal)

    def command(
        self,
        sight: Sight | None,
        posture: Posture,
        interval: float,
        view: Callable[[Channels], View],
    ) -> Command:
        """Return the controller's command after a picture: a camera twist (6,) in the camera frame
        [m/s, rad/s].

        Args:
            sight: The target as it is seen in this picture: moments, corners, plane and pose in the
                camera frame; None if it is not seen.
            posture: Camera pose, twist and joints of the robot at the time of the picture.
            interval: Time since the frame of the previous call [s].
            view: Function that takes the kinds of additional data (channels) that a component
                declares, and returns these data for this picture.

        Raises:
            PartFailed: A component raised an exception, or returned an invalid value.
        """
        # Channels first, so that each component knows this picture when it is called.
        for viewer, needs in self._viewers:
            viewer.see(view(needs))
        command = self.controller.command(sight, posture, interval)
        try:
            check_same_features(command, self._names)
        except BrokenContract as error:
            self._controller.blame(error)
        return command

    def motion_measured(self, command: Command, sight: Sight | None, interval: float) -> Array:
        """Return the measured rate (k,) at which the target's own motion changed the k features
        since the previous picture, in their units per second; nan for a feature that was not
        measured in both pictures, all nan if the command has no intermediate results (`trace`).
        Call it once for each picture, in order: it stores the error for the next call.

        Args:
            command: The command after this picture; its `trace` has the features' errors and the
                camera's part of their rates.
            sight: View of the target in this picture; None if the target is not seen.
            interval: Time since the frame of the previous call [s].
        """
        trace = command.trace
        if trace is None or sight is None:
            self._difference.forget()
            return np.full(len(self.features.names), np.nan)
        found, fresh = self._difference.measure(trace.error / trace.scales, trace.own, interval)
        return np.where(fresh, trace.scales * found, np.nan)
