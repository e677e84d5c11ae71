"""From sights to camera twists: a scenario's features, estimator and controller."""

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from servo.contracts import check_followed, check_same_features
from servo.loop.part_failures import Part
from servo.loop.settings import Setup
from servo.parts import Controller, Estimator, FeatureSet, Task
from servo.sight.difference import Difference
from servo.types import Command, Sight
from sim.channels import Channel, Channels, Sees, View, needs_of
from sim.types import Array, Camera, Posture
from tracking.types import Estimate

NO_TRUTH = (
    "this estimator needs the true motion of the target (true_motion), which only a simulation "
    "knows; with a real camera choose another one, such as kalman_cv"
)


@final
class Law:
    """What is servoed, where the target's motion comes from, and what asks for twists."""

    def __init__(
        self,
        scenario: Setup,
        camera: Camera,
        outline: Array,
        draws: Mapping[str, np.random.Generator],
    ) -> None:
        """Build the parts.

        Args:
            scenario: Kinds and settings of the parts.
            camera: Intrinsics, as they are believed to be.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            draws: Sources of the draws of "estimator" and "controller".

        Raises:
            PartFailed: A part cannot be built.
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
        self.features: FeatureSet = features.guarded(built[0])
        self.features_of_truth: FeatureSet = features.guarded(built[0], checked=False)
        """The same for records: values of what the camera cannot see need not be finite."""
        self.estimator: Estimator = estimator.guarded(built[1])
        self.controller: Controller = controller.guarded(built[2])
        parts = features, estimator, controller
        self._viewers = [
            (part.guarded(one), needs_of(part.config))
            for part, one in zip(parts, built, strict=True)
            if isinstance(one, Sees)
        ]
        self.needs = frozenset[Channel]().union(*(needs_of(part.config) for part in parts))
        """The channels that its parts declare."""
        self.is_policy = Channel.PICTURE in needs_of(scenario.controller)
        """Whether the controller is given pictures."""

    @property
    def uses_pictures(self) -> bool:
        """Whether the controller is given pictures, or features are made of pixels."""
        return Channel.PICTURE in self.needs

    def check(self, *, depths: bool, true_motion: bool) -> None:
        """Refuse what cannot be servoed.

        Args:
            depths: Whether the camera delivers depth pictures.
            true_motion: Whether the target's true motion is known.

        Raises:
            ValueError: A channel is missing, or two parts cannot go together.
        """
        if Channel.DEPTH in self._scenario.sight.needs and not depths:
            raise ValueError(
                'sight: "picture" needs a depth picture: camera.depth = true, or Frame.depth of a '
                "camera of yours"
            )
        if Channel.TRUE_MOTION not in self.needs:
            return
        if self.uses_pictures:
            raise ValueError(
                "estimator: the true motion of features made of pixels is not known; choose "
                "another one, such as none"
            )
        if not true_motion:
            raise ValueError(NO_TRUTH)

    def start(self, goal: Sight, frames_late: float) -> None:
        """Begin a task.

        Args:
            goal: The desired sight.
            frames_late: Frame intervals until a command acts.

        Raises:
            ValueError: A setting does not fit the features.
        """
        self.estimator.start(self.features)
        self._difference = Difference(self.features)
        self._goal = goal
        self.scales = self.features.scales(self.features.values(goal))
        """What the estimator's features are divided by (k,)."""
        self.controller.start(
            Task(goal, self.features, self.estimator, self._camera, self._outline, frames_late)
        )

    def check_followed(self, estimate: Estimate) -> None:
        """Refuse a tracker that follows nothing of what is servoed.

        Raises:
            PartFailed: None of the features is known by what it follows.
        """
        with self._features.naming():
            check_followed(self.features, estimate, self._goal)

    def command(
        self,
        sight: Sight | None,
        posture: Posture,
        interval: float,
        view: Callable[[Channels], View],
    ) -> Command:
        """Return the twist to ask for.

        Args:
            sight: The target as it is seen; None where it is not.
            posture: What the robot knows of itself at the time of the picture.
            interval: Time since the picture before [s].
            view: Gives the view of a part with some needs.

        Raises:
            PartFailed: A part raised an exception, or gave something that has no meaning.
        """
        for viewer, needs in self._viewers:
            viewer.see(view(needs))
        command = self.controller.command(sight, posture, interval)
        with self._controller.naming():
            check_same_features(command, self.features.names)
        return command

    def motion_measured(self, command: Command, sight: Sight | None, interval: float) -> Array:
        """Return de/dt (k,) of the target's own motion since the picture before: what the camera
        did not cause; nan where it was not measured.
        """
        trace = command.trace
        if trace is None or sight is None:
            self._difference.forget()
            return np.full(len(self.features.names), np.nan)
        found, fresh = self._difference.measure(trace.error / trace.scales, trace.own, interval)
        return np.where(fresh, trace.scales * found, np.nan)
