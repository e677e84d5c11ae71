"""Checks whether feature sets, estimators and controllers work as servobench needs them to."""

from dataclasses import replace
from functools import partial

import numpy as np

from servo.contracts import require
from servo.estimators.none import Config as NoEstimate
from servo.features.moments import Config as MomentsConfig
from servo.parts import Controller, Estimator, FeatureSet, Task
from servo.testing._examples import CAMERA, DOWN, OUTLINE, posture, seen_from
from servo.testing._subject import built, check_repetition, config_of, contract
from servo.types import DOF, OwnMotion
from sim.channels import Channel, needs_of
from sim.geometry import exp_se3
from sim.types import Array, Pose

STEP = 1e-6
"""Displacement of the camera for finite differences [m, rad]."""
TOLERANCE = 1e-4
"""Largest difference of an interaction matrix from finite differences, over its largest entry."""
POSES = ((0.02, 0.01, 0.2, 0.1), (-0.1, 0.05, -0.4, 0.0), (0.05, -0.08, 0.8, -0.15))
"""Test poses of the target: x, y [m], heading [rad], and tilt of the table [rad]."""
DT = 0.1
"""Time between two frames [s]."""


@contract
def check_features(features: object) -> None:
    """Check that a feature set works as `servo.parts.FeatureSet` requires: the same values for the
    same view of the target, no error at the goal, and a correct interaction matrix.

    The interaction matrix is compared with finite differences of the features, except for features
    that are computed from the picture's pixels.

    Args:
        features: A settings class `Config` or its instance, the name of a shipped kind such as
            "moments", or "module:Name".

    Example:
        >>> check_features("moments")

    Raises:
        BrokenContract: The feature set breaks its contract; the message says what to change.
    """
    config = config_of("features", features)
    found: FeatureSet = built("features", config, OUTLINE)
    pixels = Channel.PICTURE in needs_of(config)
    for x, y, heading, slope in POSES:
        tilted = exp_se3(np.array([0.0, 0.0, 0.0, slope, 0.0, 0.0]))
        _check_matrix(found, tilted @ Pose.planar(x, y, heading), pixels=pixels)


def _check_matrix(features: FeatureSet, target: Pose, *, pixels: bool) -> None:
    """Check the values of features for a target's pose T_room_target, and compare the interaction
    matrix with finite differences.

    Raises:
        BrokenContract: Values do not repeat, an error is not zero, or the matrix is wrong.
    """
    sight = seen_from(DOWN, target, pixels=pixels)
    values = features.values(sight)
    require(
        np.array_equal(values, features.values(sight), equal_nan=True),
        "the same view of the target gave other values the second time; compute the values "
        "from this view alone",
    )
    matrix = features.matrix(sight)
    features.known(sight)
    features.scales(values)
    zero = features.error(values, values)
    require(not np.any(zero), f"error(s, s) is {zero}; return zeros for equal features")
    if pixels:
        return  # one depth stands for all pixels, and brightness is a whole number
    found: list[Array] = []
    for twist in STEP * np.eye(6):
        after, before = (
            features.values(seen_from(DOWN @ exp_se3(sign * twist), target, pixels=False))
            for sign in (1, -1)
        )
        found.append(features.error(after, before) / (2 * STEP))
    wrong = np.abs(matrix - np.column_stack(found))
    row, column = np.unravel_index(np.argmax(wrong), wrong.shape)
    require(
        wrong.max() <= TOLERANCE * max(1.0, np.abs(matrix).max()),
        f"the interaction matrix of {features.names[row]} to {DOF[column]} is "
        f"{matrix[row, column]:.6g}, but finite differences of the values give "
        f"{found[column][row]:.6g}: correct one of them, as ds/dt = L v",
    )


@contract
def check_estimator(estimator: object) -> None:
    """Check that an estimator works as `servo.parts.Estimator` requires: valid predictions, the
    same ones for the same errors, and no memory of an earlier run.

    Args:
        estimator: A settings class `Config` or its instance, the name of a shipped kind such as
            "kalman_cv", or "module:Name".

    Example:
        >>> check_estimator("kalman_cv")

    Raises:
        BrokenContract: The estimator breaks its contract; the message says what to change.
    """
    config = config_of("estimator", estimator)
    check_repetition("estimator", config, _estimates, "the same errors gave other estimates")


def _estimates(estimator: Estimator) -> Array:
    """Return an estimator's predictions for a fixed sequence of k noisy errors with gaps: error and
    motion of each of 20 frames in turn (40, k).
    """
    features = MomentsConfig().build(OUTLINE)
    k = len(features.names)
    rng = np.random.default_rng(1)
    estimator.start(features)
    rest = OwnMotion(np.zeros(k), np.zeros((0, k)))
    estimator.skip(rest, DT)  # a loop may do so before the first update
    found: list[Array] = []
    for i in range(20):
        hidden = 12 <= i < 15
        error = 0.01 * i + rng.normal(0, 1e-4, k)
        error[-1] = np.nan if i < 2 or i == 8 else error[-1]  # nan: not measured
        prediction = estimator.skip(rest, DT) if hidden else estimator.update(error, rest, DT)
        found += [prediction.error, prediction.motion]
    return np.array(found)


@contract
def check_controller(controller: object) -> None:
    """Check that a controller works as `servo.parts.Controller` requires: valid camera twists, the
    same twists for the same views of the target, and no memory of an earlier run.

    Args:
        controller: A settings class `Config` or its instance, the name of a shipped kind such as
            "ibvs", or "module:Name".

    Example:
        >>> check_controller("ibvs")

    Raises:
        BrokenContract: The controller breaks its contract; the message says what to change.
    """
    config = config_of("controller", controller)
    for latency in (0, 2):
        twists = partial(_twists, latency, Channel.PICTURE in needs_of(config))
        check_repetition("controller", config, twists, "the same sights gave other twists")


def _twists(latency: int, pixels: bool, controller: Controller) -> Array:
    """Return a controller's camera twists (n, 6) [m/s, rad/s] for a fixed sequence of views of the
    target, some of which are missing.

    Args:
        latency: Delay of the commands [frames].
        pixels: Whether the views have pictures.
        controller: The controller.
    """
    features = MomentsConfig().build(OUTLINE)
    estimator = built("estimator", NoEstimate())
    estimator.start(features)
    seen = seen_from(DOWN, Pose.planar(0.05, 0.02, 0.3), pixels=pixels)
    goal = seen_from(DOWN, Pose.planar(0.0, 0.0, 0.0), pixels=pixels)
    seen = replace(seen, goal=goal)
    controller.start(Task(goal, features, estimator, CAMERA, OUTLINE, latency))
    twists: list[Array] = []
    for sight in (None, seen, None, seen, *[None] * 30, seen):
        twists.append(controller.command(sight, posture(), DT).twist)
    return np.array(twists)
