"""The contract of each kind of part: the methods that it has, and what they may return.

`guarded` makes a part whose calls are checked. The loop, `servo.testing` and our own tests call
parts that way, so that all of them agree.
"""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from numbers import Real
from typing import Any, TypeVar, cast, final

import numpy as np

from servo.parts import FeatureSet
from servo.types import DOF, Command, Mode, OwnMotion, Prediction, Sight, Trace
from sim.channels import VIEWED, Sees, needs_of
from sim.geometry import is_rotation
from sim.outline import area
from sim.types import Array, Effect, Pose
from tracking.types import Estimate, State, Status, goes_around

Built = TypeVar("Built")
Check = Callable[..., None]
"""Checks what a method of a part returned; it also gets the arguments of the call."""
ROUNDING = 1e-9
"""A variance may be negative by this much: the difference of two nearly equal ones. So may the
product of a rotation with its transpose leave the identity."""
SMALLEST_AREA = 1e-6
"""Area of corners below which no pose of a rectangle can be computed from them [px^2]."""
LARGEST = 1e9
"""Largest number of a state: products of larger ones would overflow."""

MOST = 2**63 - 1
"""Largest whole number of a table."""


class BrokenContract(AssertionError):
    """A part does not do what its kind must do; the sentence says what, and what would be right."""


def require(holds: object, sentence: str, *values: object) -> None:
    """Raise a sentence where something does not hold.

    Args:
        holds: What should be true.
        sentence: What is wrong, and what would be right; {} where a value stands.
        values: They are written only where it is raised: to write an array takes long.

    Raises:
        BrokenContract: It does not hold.
    """
    if not holds:
        raise BrokenContract(sentence.format(*values) if values else sentence)


def check_estimate(estimate: object, *_: object) -> None:
    """Check what a tracker reports for a picture.

    Raises:
        BrokenContract: It is no `Estimate`, or a number in it has no meaning.
    """
    e = estimate
    if not isinstance(e, Estimate):
        raise BrokenContract(f"update returned {type(e).__name__}; return an Estimate")
    s = e.state
    require(type(s) is State, "the state is {}; use tracking.types.State", type(s).__name__)
    numbers = (s.x, s.y, s.theta, s.scale)
    right = all(isinstance(n, Real) and abs(n) <= LARGEST for n in numbers)  # nan is not
    require(
        right and s.scale * LARGEST >= 1,
        "the state is {}; its numbers must be finite, scale above 0, none over {:g}",
        s,
        LARGEST,
    )
    require(
        isinstance(e.distance, Real) and 0 <= e.distance <= 1,
        "the distance is {}; it goes from 0 to 1",
        e.distance,
    )
    require(type(e.status) is Status, "the status is {!r}; use tracking.types.Status", e.status)
    require(
        isinstance(e.ess, Real) and not e.ess < 0,
        "the effective sample size is {!r}; it is a number from 0 on, or nan",
        e.ess,
    )
    whole = isinstance(e.evaluations, Real) and 0 <= e.evaluations <= MOST
    require(
        whole and e.evaluations == int(e.evaluations),
        "evaluations is {!r}; it is a whole number from 0 on",
        e.evaluations,
    )
    flags = np.asarray(e.follows)
    require(
        flags.shape == (2,) and flags.dtype == np.bool_,
        "follows is not two flags: whether angle, and size, are followed",
    )
    require(
        _is_array(e.covariance, (4, 4), finite=False),
        "the covariance is not (4, 4); a tracker without one gives unknown_covariance()",
    )
    variances = np.diagonal(e.covariance)
    negative = (variances < -ROUNDING).any()
    require(not negative, "the variances are {}; none can be negative", variances)
    _check_corners(e.corners)
    count = len(e.particles) if isinstance(e.particles, np.ndarray) and e.particles.ndim else 0
    require(
        e.particles is None or _is_array(e.particles, (count, 5)),
        "the particles are not (N, 5): x, y, theta, scale, weight",
    )


def _check_corners(corners: object) -> None:
    """Refuse corners that no picture of a rectangle has."""
    if corners is None:
        return
    found = np.asarray(corners)
    right = _is_array(corners, (4, 2)) and bool((np.abs(found) <= LARGEST).all())
    require(right, "the corners are not four points (4, 2) of finite numbers up to {:g}", LARGEST)
    require(
        goes_around(found) and area(found) >= SMALLEST_AREA,
        "the corners are {}; they should lie around an area in the order of Region.corners",
        found.tolist(),
    )


def outline_fault(outline: Array) -> str:
    """Return what is wrong with the corners (4, 3) of a reference rectangle; nothing where they are
    those of one, level and clockwise as seen from above.
    """
    given = np.asarray(outline, float)
    sides = np.diff(given, axis=0, append=given[:1])
    size = np.abs(sides).max()
    if np.abs(sides[:, 2]).max() > ROUNDING * size:
        return f"expected four corners of one height, got the heights {given[:, 2].tolist()}"
    (x, y, _), (u, v, _) = sides[:2]
    opposite = np.abs(sides[0] + sides[2]).max() <= ROUNDING * size
    if not opposite or abs(x * u + y * v) > ROUNDING * size**2 or x * v >= y * u:
        wanted = "the four corners of a rectangle, clockwise as seen from above"
        return f"expected {wanted}, got {given[:, :2].tolist()}"
    return ""


def _is_array(values: object, shape: tuple[int, ...], *, finite: bool = True) -> bool:
    """Return whether values are an array of real numbers of a shape, all of them finite."""
    return (
        isinstance(values, np.ndarray)
        and values.shape == shape
        and values.dtype.kind in "fiu"
        and (not finite or bool(np.isfinite(values).all()))
    )


def _require_array(values: object, what: str) -> None:
    """Refuse a list, and an array of something else than numbers: both are printed as numbers."""
    if not isinstance(values, np.ndarray):
        kind = type(values).__name__
    elif values.dtype.kind in "fiu":
        return
    else:
        kind = f"array of {values.dtype}"
    raise BrokenContract(f"{what} is of type {kind}; it should be a NumPy array of six floats")


def check_features(features: FeatureSet, method: str, found: object, *_: object) -> None:
    """Check what a method of a feature set returned: for each name a number, six in the matrix.

    Raises:
        BrokenContract: It has another shape or type, or a number in it has no meaning.
    """
    k = len(features.names)
    shape = (k, 6) if method == "matrix" else (k,)
    if not isinstance(found, np.ndarray):
        raise BrokenContract(f"{method} returned {type(found).__name__}; it should be {shape}")
    require(found.shape == shape, "{} returned {}; it should be {}", method, found.shape, shape)
    if method == "known":
        require(found.dtype == np.bool_, "known returned {}; it should be {} flags", found, k)
        return
    # An error may hold nan: that of a feature which was not measured.
    right = _is_array(found, shape, finite=method != "error")
    right = right and (method != "error" or not np.isinf(found).any())
    require(right, "{} returned {}; all must be finite", method, found)
    require(
        method != "scales" or (found > 0).all(), "scales returned {}; all must be above 0", found
    )


def check_names(features: FeatureSet) -> None:
    """Check the names of a feature set, and what it gives for each of them.

    Raises:
        BrokenContract: Two have one name, or what is said is not of these names.
    """
    names = features.names
    k = len(names)
    right = len(set(names)) == k and set(map(type, names)) == {str}
    require(right, "names are {}; all must differ", names)
    require(len(features.units) == k, "there are {} names and {} units", k, len(features.units))
    require(set(features.feed_forward) <= {*names}, "feed_forward names features that do not exist")
    right = set(features.sole_dof) <= {*names} and set(features.sole_dof.values()) <= {*DOF}
    require(right, "sole_dof maps names of features to some of {}", ", ".join(DOF))
    require(
        _is_array(features.noise, (k,)) and (features.noise > 0).all(),
        "noise is not {} numbers above 0",
        k,
    )


def check_prediction(method: str, prediction: object, given: Array | OwnMotion, *_: object) -> None:
    """Check what an estimator returned: finite numbers, as many as there are features.

    Args:
        method: "update" or "skip"; the latter has no measurement, so no innovation.
        prediction: What it returned.
        given: The first argument: the error, or the camera's own part of its change.

    Raises:
        BrokenContract: It is no `Prediction`, or a number in it has no meaning.
    """
    p = prediction
    if not isinstance(p, Prediction):
        raise BrokenContract(f"{method} returned {type(p).__name__}, not a Prediction")
    k = len(given.past if isinstance(given, OwnMotion) else given)
    for name in ("error", "motion", "innovation", "nis"):
        values = getattr(p, name)
        finite = name in ("error", "motion")
        kind = "finite numbers" if finite else "numbers, nan for none"
        right = _is_array(values, (k,), finite=finite)
        require(right, "{}: {} is {}; it should be {} {}", method, name, values, k, kind)
    require(
        method == "update" or np.isnan(p.innovation).all(),
        "skip: nothing was measured, so the innovation is nan; "
        "Prediction.unmeasured makes such a value",
    )


def check_command(command: object, *_: object) -> None:
    """Check what a controller asks for: six finite numbers.

    Raises:
        BrokenContract: It is no `Command`, or no robot can follow it.
    """
    if not isinstance(command, Command):
        raise BrokenContract(f"command returned {type(command).__name__}; return a Command")
    _require_array(command.twist, "the twist")
    require(
        _is_array(command.twist, (6,)),
        "the twist is {}; it should be six finite numbers (vx, vy, vz, wx, wy, wz)",
        command.twist,
    )
    flag = command.saturated
    require(type(flag) in (bool, np.bool_), "saturated is {!r}; it is True or False", flag)
    require(type(command.mode) is Mode, "the mode is {!r}; use servo.types.Mode", command.mode)
    named: dict[str, object] = {"limits": command.limits, "violated": command.violated}
    for name, limits in named.items():
        right = isinstance(limits, tuple) and all(type(each) is str for each in limits)
        require(right, "{} is {!r}; it is a tuple of names", name, limits)
    _check_trace(command.trace)


def _check_trace(trace: object) -> None:
    """Check how a law says that it came to its twist: numbers, as many as there are features."""
    if trace is None:
        return
    if not isinstance(trace, Trace):
        raise BrokenContract(f"the trace is {type(trace).__name__}; use a Trace or None")
    k = np.size(trace.features)
    for name in ("features", "error", "scales", "own"):
        values = getattr(trace, name)
        right = _is_array(values, (k,), finite=False)
        require(
            right, "the trace's {} is {!r}; it should be {} numbers, nan for none", name, values, k
        )


def check_same_features(command: Command, names: tuple[str, ...]) -> None:
    """Check that a law says this of the features of its scenario.

    Raises:
        BrokenContract: The law has another number of features.
    """
    count = len(names) if command.trace is None else len(command.trace.features)
    require(
        count == len(names),
        "the trace has {} features, but the scenario has {}: {}",
        count,
        len(names),
        ", ".join(names),
    )


def check_pose(pose: object, time: float) -> None:
    """Check where a motion puts the target.

    Raises:
        BrokenContract: It is no `Pose`, a number in it is not finite, or its rotation is wrong.
    """
    if not isinstance(pose, Pose):
        raise BrokenContract(f"at returned {type(pose).__name__}, not a Pose")
    R = pose.rotation
    require(
        _is_array(R, (3, 3)) and _is_array(pose.translation, (3,)),
        "the target's position is {}, its rotation {}; these must be finite numbers (3,) and "
        "(3, 3)",
        pose.translation,
        R,
    )
    require(is_rotation(R, ROUNDING), "at({:g}) is no pose: its matrix (3, 3) is no rotation", time)


def check_effect(effect: object, time: float) -> None:
    """Check what a disturbance does to the world.

    Raises:
        BrokenContract: It is no `Effect`, a factor in it has no meaning, or it is early.
    """
    if not isinstance(effect, Effect):
        raise BrokenContract(f"at returned {type(effect).__name__}; return an Effect")
    for name, factor in (("gain", effect.gain), ("lamp", effect.lamp)):
        right = isinstance(factor, Real) and 0 <= factor <= LARGEST
        require(right, "the {} is {!r}; it is a factor from 0 on", name, factor)
    require(
        time >= 0 or effect == Effect(), "it does something before time 0; return Effect() there"
    )


CONTRACTS: Mapping[str, Mapping[str, Check | None]] = {
    "tracker": {"start": None, "update": check_estimate},
    "estimator": {
        "start": None,
        "update": partial(check_prediction, "update"),
        "skip": partial(check_prediction, "skip"),
    },
    "controller": {"start": None, "command": check_command},
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
        BrokenContract: A method is missing, it has another type, or its outline is no rectangle.
    """
    kind = type(built).__name__
    for name in _checks_of(place, built):
        if not callable(getattr(built, name, None)):
            raise BrokenContract(f"build returned {kind}, which has no method {name}")
    if place == "features":
        check_names(cast(FeatureSet, built))
    if place == "controller":
        require(
            not hasattr(built, "aim"),
            "it has a method aim, which is not called: command finds the goal in seen.goal",
        )
    if place == "disturbances":
        right = isinstance(getattr(built, "props", None), tuple)
        require(right, "it has no tuple `props`; () if it needs nothing in the scene")
    if place in ("robot", "target"):
        _check_model(place, built)


def check_sees(config: object, built: object) -> None:
    """Check that a part can be given the channels that its `Config` declares.

    Raises:
        BrokenContract: It has no method `see`.
    """
    viewed = needs_of(config) & VIEWED
    require(
        not viewed or isinstance(built, Sees),
        "its Config needs {}, but it has no method see(view) to take that",
        " and ".join(sorted(channel.name for channel in viewed)),
    )


def _check_model(place: str, built: object) -> None:
    from sim.kinematics.robot import Design
    from sim.models.target import Target  # MuJoCo: not for a tracker alone

    kind = Design if place == "robot" else Target
    if not isinstance(built, kind):
        raise BrokenContract(f"build returned {type(built).__name__}; return a {kind.__name__}")
    if isinstance(built, Target):
        right = _is_array(built.outline, (4, 3))
        require(right, "the outline is not four corners (4, 3) of finite numbers")
        fault = outline_fault(built.outline)
        require(not fault, "the outline: {}", fault)


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
            f"the tracker follows no {missing} of this target, without which none of them is known"
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
        # From Python 3.12 on `isinstance` with a protocol does not ask `__getattr__`.
        for name in dir(type(part)):
            if not name.startswith("_") and callable(getattr(type(part), name)):
                getattr(self, name)

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
                    check(result, *arguments)
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
    return cast(Built, _Guarded(part, _checks_of(place, part) if checked else {}, naming))
