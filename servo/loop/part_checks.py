"""What the parts of a run give is checked, so that nonsense is named and never acted on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from servo.loop.part_failed import PartFailed
from servo.parts import FeatureSet
from servo.types import Command, Sight
from sim.models.target import Target
from sim.robot.design import Design
from tracking.types import Estimate, Status

METHODS = {
    "tracker": ("start", "update"),
    "features": ("values", "matrix", "error", "known", "scales"),
    "estimator": ("start", "update", "skip"),
    "controller": ("start", "aim", "command"),
    "motion": ("at",),
    "disturbances": ("at",),
}
"""What each kind of part must have."""
TYPES = {"robot": Design, "target": Target}


def check_built(part: str, config: Any, built: Any) -> Any:
    """Refuse what is no part of its kind.

    Raises:
        PartFailed: It is of another type, lacks a method, or its rectangle is not finite.
    """
    what = part.partition("[")[0]
    kind = type(built).__name__
    wanted = TYPES.get(what)
    if wanted is not None and not isinstance(built, wanted):
        raise PartFailed.by(part, config, f"build returned {kind} instead of a {wanted.__name__}")
    for name in METHODS.get(what, ()):
        if not callable(getattr(built, name, None)):
            raise PartFailed.by(part, config, f"build returned {kind}, which has no method {name}")
    if isinstance(built, Target) and not np.isfinite(built.outline).all():
        raise PartFailed.by(part, config, "its reference rectangle is not finite")
    return built


def check_estimate(estimate: Any, config: Any) -> Estimate:
    """Refuse what a tracker may not return.

    Raises:
        PartFailed: It is no `Estimate`, or a number in it is not finite.
    """
    if not isinstance(estimate, Estimate):
        what = f"update returned {type(estimate).__name__} instead of an Estimate"
        raise PartFailed.by("tracker", config, what)
    s = estimate.state
    numbers = {"x": s.x, "y": s.y, "theta": s.theta, "scale": s.scale}
    numbers["distance"] = estimate.distance
    if not all(map(_is_finite, numbers.values())) or s.scale <= 0:
        said = ", ".join(f"{name} = {value}" for name, value in numbers.items())
        what = f"update returned {said}; all must be finite numbers, and the scale above 0"
        raise PartFailed.by("tracker", config, what)
    if np.shape(estimate.covariance) != (4, 4) or len(estimate.follows) != 2:
        what = "update returned a covariance that is not (4, 4), or not two flags in follows"
        raise PartFailed.by("tracker", config, what)
    status: Any = estimate.status
    if not isinstance(status, Status):
        raise PartFailed.by("tracker", config, f"update returned the status {status!r}")
    corners = estimate.corners
    if corners is not None and (np.shape(corners) != (4, 2) or not np.isfinite(corners).all()):
        what = "update returned corners that are not four points (4, 2) of finite numbers"
        raise PartFailed.by("tracker", config, what)
    return estimate


def _is_finite(value: Any) -> bool:
    return isinstance(value, float | int) and math.isfinite(value)


def check_command(
    command: Any, parts: Mapping[str, tuple[Any, ...]], sight: Sight | None
) -> Command:
    """Refuse a command that no robot can follow, and name the part that gave the numbers.

    Raises:
        PartFailed: It is no `Command`, or a number in it is not finite.
    """
    config = parts["controller"][0]
    if not isinstance(command, Command):
        what = f"command returned {type(command).__name__} instead of a Command"
        raise PartFailed.by("controller", config, what)
    shown = np.zeros(0) if command.trace is None else command.trace.error
    if np.shape(command.twist) == (6,) and np.isfinite([*command.twist, *shown]).all():
        return command
    given = {} if sight is None else {"features": parts["features"][1].values(sight)}
    if (trace := command.trace) is not None:
        given["estimator"] = trace.prediction.error
    for part, values in given.items():
        if not np.isfinite(values).all():
            raise PartFailed.by(part, parts[part][0], f"gave the values {np.array(values)}")
    what = f"the twist is {np.array(command.twist)}; it should be six finite numbers"
    raise PartFailed.by("controller", config, what)


def check_known(config: Any, features: FeatureSet, estimate: Estimate, goal: Sight) -> None:
    """Refuse features of which the tracker, which has reported what it follows, gives none.

    Raises:
        PartFailed: There are none.
    """
    angle, size = (follows or estimate.corners is not None for follows in estimate.follows)
    sight = replace(goal, angle_known=angle, size_known=size)
    if not (angle and size) and not features.known(sight).any():
        missing = " nor ".join(["angle"] * (not angle) + ["size"] * (not size))
        what = f"the tracker follows no {missing}, without which none of them is known"
        raise PartFailed.by("features", config, what)
