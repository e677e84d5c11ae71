"""The contract of each kind of part: the methods that it has, and what they may return.

`guarded` makes a part whose calls are checked. The loop, `servo.testing` and our own tests call
parts that way, so that all of them agree.
"""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from math import isfinite
from numbers import Real
from typing import Any, TypeVar, cast, final

import numpy as np

from servo.parts import FeatureSet
from servo.types import Command, Prediction, Sight
from sim.types import Array, Effect, Pose
from tracking.types import Estimate, Status

Built = TypeVar("Built")
Check = Callable[[Any], None]
"""Checks what a method of a part returned."""
ROUNDING = 1e-9
"""A variance may be negative by this much: the difference of two nearly equal ones."""


class BrokenContract(AssertionError):
    """A part does not do what its kind must do; the sentence says what, and what would be right."""


def require(holds: object, sentence: str) -> None:
    """Raise the sentence where something does not hold.

    Raises:
        BrokenContract: It does not hold.
    """
    if not holds:
        raise BrokenContract(sentence)


def check_estimate(estimate: object) -> None:
    """Check what a tracker reports for a picture.

    Raises:
        BrokenContract: It is no `Estimate`, or a number in it has no meaning.
    """
    e = estimate
    if not isinstance(e, Estimate):
        raise BrokenContract(f"update returned {type(e).__name__}; return an Estimate")
    s = e.state
    finite = all(map(_is_finite, (s.x, s.y, s.theta, s.scale)))
    if not finite or s.scale <= 0:
        raise BrokenContract(f"the state is {s}; its numbers must be finite, scale above 0")
    if not (_is_finite(e.distance) and 0 <= e.distance <= 1):
        raise BrokenContract(f"the distance is {e.distance}; it goes from 0 to 1")
    if type(e.status) is not Status:
        raise BrokenContract(f"the status is {e.status!r}; use tracking.types.Status")
    if len(e.follows) != 2:
        raise BrokenContract("follows is not two flags: whether angle, and size, are followed")
    if np.shape(e.covariance) != (4, 4):
        raise BrokenContract(
            "the covariance is not (4, 4); a tracker without one gives unknown_covariance()"
        )
    variances = np.diagonal(e.covariance)
    if (variances < -ROUNDING).any():
        raise BrokenContract(f"the variances are {variances}; none can be negative")
    if e.corners is not None and not _is_array(e.corners, (4, 2)):
        raise BrokenContract("the corners are not four points (4, 2) of finite numbers")


def _is_finite(number: object) -> bool:
    return isinstance(number, Real) and isfinite(number)


def _is_array(values: object, shape: tuple[int, ...]) -> bool:
    """Whether values have a shape, and all are finite numbers."""
    return np.shape(cast(Array, values)) == shape and bool(np.isfinite(cast(Array, values)).all())


def check_features(features: FeatureSet, method: str, found: Array) -> None:
    """Check what a method of a feature set returned: for each name a number, six in the matrix.

    Raises:
        BrokenContract: It has another shape or type, or a number in it has no meaning.
    """
    k = len(features.names)
    shape = (k, 6) if method == "matrix" else (k,)
    if np.shape(found) != shape:
        raise BrokenContract(f"{method} returned {np.shape(found)}; it should be {shape}")
    # An error may hold nan: that of a feature which was not measured.
    if method in ("values", "matrix") and not np.isfinite(found).all():
        raise BrokenContract(f"{method} returned {np.array(found)}; all must be finite")
    if method == "known" and np.asarray(found).dtype != np.bool_:
        raise BrokenContract(f"known returned {found}; it should be {k} flags")
    if method == "scales" and not (np.asarray(found) > 0).all():
        raise BrokenContract(f"scales returned {found}; all must be above 0")


def check_prediction(prediction: object, method: str) -> None:
    """Check what an estimator returned: finite numbers, as many of the motion as of the error.

    Raises:
        BrokenContract: It is no `Prediction`, or a number in it is not finite.
    """
    if not isinstance(prediction, Prediction):
        raise BrokenContract(f"{method} returned {type(prediction).__name__}, not a Prediction")
    k = len(prediction.innovation)
    for name, values in (("error", prediction.error), ("motion", prediction.motion)):
        right = _is_array(values, (k,))
        require(right, f"{method}: {name} is {np.array(values)}; it should be {k} finite numbers")


def check_skip(prediction: object) -> None:
    """Check the prediction without a measurement.

    Raises:
        BrokenContract: It is none, or has an innovation.
    """
    check_prediction(prediction, "skip")
    require(
        np.isnan(cast(Prediction, prediction).innovation).all(),
        "skip: nothing was measured, so the innovation is nan; "
        "Prediction.unmeasured makes such a value",
    )


def check_command(command: object) -> None:
    """Check what a controller asks for: six finite numbers.

    Raises:
        BrokenContract: It is no `Command`, or no robot can follow it.
    """
    if not isinstance(command, Command):
        raise BrokenContract(f"command returned {type(command).__name__}; return a Command")
    if not _is_array(command.twist, (6,)):
        raise BrokenContract(
            f"the twist is {np.array(command.twist)}; it should be six finite numbers "
            "(vx, vy, vz, wx, wy, wz)"
        )


def check_pose(pose: object) -> None:
    """Check where a motion puts the target.

    Raises:
        BrokenContract: It is no `Pose`, or a number in it is not finite.
    """
    if not isinstance(pose, Pose):
        raise BrokenContract(f"at returned {type(pose).__name__}, not a Pose")
    if not (_is_array(pose.rotation, (3, 3)) and _is_array(pose.translation, (3,))):
        raise BrokenContract(
            f"the target's position is {pose.translation}, its rotation {pose.rotation}; these "
            "must be finite numbers (3,) and (3, 3)"
        )


def check_effect(effect: object) -> None:
    """Check what a disturbance does to the world.

    Raises:
        BrokenContract: It is no `Effect`.
    """
    require(isinstance(effect, Effect), f"at returned {type(effect).__name__}; return an Effect")


CONTRACTS: Mapping[str, Mapping[str, Check | None]] = {
    "tracker": {"start": None, "update": check_estimate},
    "estimator": {
        "start": None,
        "update": partial(check_prediction, method="update"),
        "skip": check_skip,
    },
    "controller": {"start": None, "aim": None, "command": check_command},
    "motion": {"at": check_pose},
    "disturbances": {"at": check_effect},
}
"""The methods that each part must have, by its place in a scenario, and the check of what each
returns."""
FEATURES = ("values", "matrix", "error", "known", "scales")
"""The methods of features, whose number decides what is right."""


def _checks_of(place: str, part: object) -> Mapping[str, Check | None]:
    if place == "features":
        features = cast(FeatureSet, part)
        return {name: partial(check_features, features, name) for name in FEATURES}
    return CONTRACTS.get(place, {})


def check_built(place: str, built: object) -> None:
    """Check what a `Config` built: that it has the methods, or the type, of its kind.

    Args:
        place: Its place in a scenario, such as "tracker".
        built: What it built.

    Raises:
        BrokenContract: A method is missing, it has another type, or its outline is not finite.
    """
    kind = type(built).__name__
    for name in _checks_of(place, built):
        if not callable(getattr(built, name, None)):
            raise BrokenContract(f"build returned {kind}, which has no method {name}")
    if place in ("robot", "target"):
        _check_model(place, built)


def _check_model(place: str, built: object) -> None:
    from sim.kinematics.robot import Design
    from sim.models.target import Target  # MuJoCo: not for a tracker alone

    kind = Design if place == "robot" else Target
    if not isinstance(built, kind):
        raise BrokenContract(f"build returned {type(built).__name__}; return a {kind.__name__}")
    if isinstance(built, Target) and not _is_array(built.outline, (4, 3)):
        raise BrokenContract("the outline is not four corners (4, 3) of finite numbers")


def check_followed(features: FeatureSet, estimate: Estimate, goal: Sight) -> None:
    """Check that features can be measured by a tracker that has reported what it follows.

    Raises:
        BrokenContract: None of them is known by what it follows.
    """
    angle, size = (follows or estimate.corners is not None for follows in estimate.follows)
    sight = replace(goal, angle_known=angle, size_known=size)
    if not (angle and size) and not features.known(sight).any():
        missing = " nor ".join(["angle"] * (not angle) + ["size"] * (not size))
        raise BrokenContract(
            f"the tracker follows no {missing}, without which none of them is known"
        )


@final
class _Guarded:
    """A part whose calls are checked; everything else is its own."""

    def __init__(
        self,
        part: object,
        checks: Mapping[str, Check | None],
        naming: Callable[[str], AbstractContextManager[Any]],
    ) -> None:
        self._part = part
        self._checks = checks
        self._naming = naming

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._part, name)
        if not callable(found):
            return found
        check = self._checks.get(name)
        naming = self._naming(name)

        def call(*arguments: Any, **named: Any) -> Any:
            with naming:
                result = found(*arguments, **named)
                if check is not None:
                    check(result)
                return result

        setattr(self, name, call)  # the next call finds it without coming here
        return call


def guarded(
    part: Built,
    place: str,
    naming: Callable[[str], AbstractContextManager[Any]] = nullcontext,
    *,
    checked: bool = True,
) -> Built:
    """Return the part with all its calls checked.

    Args:
        part: What a `Config` built.
        place: Its place in a scenario, such as "tracker".
        naming: Gives the context, used again and again, in which a method of this name is called:
            it may turn an exception into one that names the part.
        checked: Whether what the methods return is checked too.
    """
    checks = _checks_of(place, part) if checked else {}
    return cast(Built, _Guarded(part, checks, naming))
