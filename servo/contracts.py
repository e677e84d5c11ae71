"""Contracts of a run's components (tracker, controller, ...): the methods that each must have, and
the values that these may return.

`guarded` wraps a component so that each of its calls is checked. The loop, `servo.testing` and our
own tests call components through it, so that all of them accept and refuse the same.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from numbers import Real
from typing import Any, TypeGuard, TypeVar, cast, final

import numpy as np

from servo.parts import FeatureSet
from servo.types import DOF, Command, Mode, OwnMotion, Prediction, Sight, Trace
from sim.channels import BY_ARGUMENTS, Channel, Sees, needs_of
from sim.geometry import is_finite, is_rotation
from sim.outline import area
from sim.types import Array, Effect, Pose
from tracking.types import Estimate, Region, State, Status, goes_around

Built = TypeVar("Built")
Value = TypeVar("Value")
Check = Callable[..., None]
"""Checks the value that a method returned; it also gets the arguments of the call."""
ROUNDING = 1e-9
"""Rounding errors that are tolerated: of a variance below zero (the difference of two nearly equal
ones), and of a rotation's product with its transpose against the identity."""
SMALLEST_AREA = 1e-6
"""Area of corners below which no pose of a rectangle can be computed from them [px^2]."""
LARGEST = 1e9
"""Largest number of a state: products of larger ones would overflow."""
MOST = 2**63 - 1
"""Largest whole number of a table."""


class BrokenContract(AssertionError):
    """Error: a component, such as a tracker, breaks its contract; the message says what is wrong
    and what would be right.
    """


def require(holds: object, sentence: str, *values: object) -> None:
    """Raise an error if a condition does not hold.

    Args:
        holds: The condition; any object is taken as true or false.
        sentence: What is wrong and what would be right, with {} in place of each value.
        *values: Values to insert; they are formatted only on failure, as formatting arrays is slow.

    Raises:
        BrokenContract: The condition is false.
    """
    if not holds:
        raise BrokenContract(sentence.format(*values) if values else sentence)


def require_type(value: object, kind: type[Value], method: str) -> Value:
    """Return a value that a component's method returned, unchanged, after checking its type.

    Args:
        value: The returned value.
        kind: The required type; subclasses are accepted.
        method: Name of the method, for the message.

    Raises:
        BrokenContract: The value has another type.
    """
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise BrokenContract(
            f"{method} returned {type(value).__name__}; return {article} {kind.__name__}"
        )
    return value


@dataclass(frozen=True, slots=True)
class Rule:
    """A condition on one field of an object that a component returned, with the words for the error
    message if the field breaks it.
    """

    field: str
    """Name of the field."""
    holds: Callable[[Any], object]
    """Returns whether a value of the field is valid."""
    right: str
    """The end of the sentence for an invalid value, such as "it should be from 0 to 1"."""


def require_fields(value: object, rules: Iterable[Rule], prefix: str = "") -> None:
    """Check the fields of an object by rules, one after the other.

    Args:
        value: The object that has the fields.
        rules: The rules; several may be about one field.
        prefix: Beginning of the error's message, such as "skip: ".

    Raises:
        BrokenContract: A field breaks its rule; the message names the first such field, its value,
            and what would be right.
    """
    for rule in rules:
        found = getattr(value, rule.field)
        if not rule.holds(found):
            text = str(found) if isinstance(found, np.ndarray) else repr(found)
            raise BrokenContract(
                f"{prefix}{type(value).__name__}.{rule.field} is {text}; {rule.right}"
            )


def is_array(values: object, shape: tuple[int, ...], *, finite: bool = True) -> bool:
    """Return True if an object is a NumPy array of floats or integers (not booleans) with a shape.

    Args:
        values: Any object.
        shape: The required shape.
        finite: Whether all numbers must be finite; False: nan and infinities are allowed.
    """
    return (
        isinstance(values, np.ndarray)
        and values.shape == shape
        and values.dtype.kind in "fiu"
        and (not finite or is_finite(values))
    )


def _is_exactly(kind: type, value: object) -> bool:
    return type(value) is kind


def _is_number(value: object, least: float = -LARGEST, most: float = LARGEST) -> bool:
    return _is_real(value) and bool(least <= value <= most)  # nan is not


def _is_real(value: object) -> TypeGuard[float]:
    # An abstract class takes much longer than the two types that nearly all numbers have.
    return type(value) in (float, int) or isinstance(value, Real)


def _is_state(state: State) -> bool:
    numbers = (state.x, state.y, state.theta, state.scale)
    return all(map(_is_number, numbers)) and state.scale * LARGEST >= 1


def _is_sample_size(ess: object) -> bool:
    return _is_real(ess) and not ess < 0  # nan: a tracker without particles


def _is_count(value: Any) -> bool:
    return _is_number(value, 0, MOST) and value == int(value)


def _is_flag(value: object) -> bool:
    return type(value) in (bool, np.bool_)


def _is_trace(value: object) -> bool:
    return value is None or isinstance(value, Trace)


def _are_flags(value: object) -> bool:
    flags = np.asarray(value)
    return flags.shape == (2,) and flags.dtype == np.bool_


def _has_variances(covariance: Array) -> bool:
    return not (covariance.diagonal() < -ROUNDING).any()  # nan: unknown


def _are_points(corners: Array | None) -> bool:
    return corners is None or (
        is_array(corners, (4, 2)) and bool((np.abs(corners) <= LARGEST).all())
    )


def _are_corners(corners: Array | None) -> bool:
    return corners is None or (goes_around(corners) and area(corners) >= SMALLEST_AREA)


def _are_particles(particles: object) -> bool:
    count = len(particles) if isinstance(particles, np.ndarray) and particles.ndim else 0
    return particles is None or is_array(particles, (count, 5))


def _are_names(names: object) -> bool:
    return isinstance(names, tuple) and {*map(type, cast(Any, names))} <= {str}


ESTIMATE = (
    Rule("state", partial(_is_exactly, State), "use tracking.types.State"),
    Rule(
        "state",
        _is_state,
        f"its numbers must be finite, scale above 0, none over {LARGEST:g}",
    ),
    Rule("distance", partial(_is_number, least=0, most=1), "it should be from 0 to 1"),
    Rule("status", partial(_is_exactly, Status), "use tracking.types.Status"),
    Rule("ess", _is_sample_size, "it should be a number of at least 0, or nan"),
    Rule("evaluations", _is_count, "it should be a whole number of at least 0"),
    Rule(
        "follows", _are_flags, "it should be two flags: whether the tracker follows angle, and size"
    ),
    Rule(
        "covariance",
        partial(is_array, shape=(4, 4), finite=False),
        "it should be an array (4, 4); a tracker without one gives unknown_covariance()",
    ),
    Rule("covariance", _has_variances, "its variances cannot be negative"),
    Rule(
        "corners",
        _are_points,
        f"it should be an array of four points (4, 2) of finite numbers up to {LARGEST:g}",
    ),
    Rule(
        "corners",
        _are_corners,
        "they should lie around an area in the order of Region.corners",
    ),
    Rule(
        "particles",
        _are_particles,
        "it should be an array (N, 5) of finite numbers: x, y, theta, scale, weight",
    ),
)
"""The rules of `tracking.types.Estimate`."""
COMMAND = (
    Rule(
        "twist",
        partial(is_array, shape=(6,)),
        "it should be a NumPy array of six finite numbers (vx, vy, vz, wx, wy, wz)",
    ),
    Rule("saturated", _is_flag, "it should be True or False"),
    Rule("mode", partial(_is_exactly, Mode), "use servo.types.Mode"),
    Rule("limits", _are_names, "it should be a tuple of names"),
    Rule("violated", _are_names, "it should be a tuple of names"),
    Rule("trace", _is_trace, "use a servo.types.Trace, or None"),
)
"""The rules of `servo.types.Command`."""
EFFECT = tuple(
    Rule(field, partial(_is_number, least=0), f"it should be a factor from 0 to {LARGEST:g}")
    for field in ("gain", "lamp")
)
"""The rules of `sim.types.Effect`."""
POSE = (
    Rule("translation", partial(is_array, shape=(3,)), "it should be finite numbers (3,)"),
    Rule("rotation", partial(is_array, shape=(3, 3)), "it should be finite numbers (3, 3)"),
)
"""The rules of `sim.types.Pose`."""


def check_outline(found: object, *_: object) -> None:
    """Check what a tracker's method `outline` returned: the region [px] of the target that it found
    in the first picture, and its state there.

    Args:
        found: The returned value.

    Raises:
        BrokenContract: The value is no tuple of a `Region` and a `State`.
    """
    types = tuple(map(type, cast(tuple[object, ...], found))) if isinstance(found, tuple) else ()
    require(
        types == (Region, State),
        "outline returned {}, which is not (Region, State)",
        found,
    )


def check_estimate(estimate: object, *_: object) -> None:
    """Check the estimate that a tracker's method `update` returned for a picture; further arguments
    are ignored.

    Raises:
        BrokenContract: The object is no `Estimate`, or one of its fields is invalid.
    """
    require_fields(require_type(estimate, Estimate, "update"), ESTIMATE)


def outline_fault(outline: Array) -> str:
    """Return a sentence on what is wrong with the corners of a target's reference rectangle; "" if
    they are valid.

    Args:
        outline: Corners (4, 3) in the target's frame [m]. They are valid if they form a rectangle,
            have the same z, and are in clockwise order as seen from above (from +z).
    """
    given = np.asarray(outline, float)
    sides = np.diff(given, axis=0, append=given[:1])
    size = np.abs(sides).max()
    if np.abs(sides[:, 2]).max() > ROUNDING * size:
        return f"expected four corners of one height, got the heights {given[:, 2].tolist()}"
    (x, y, _), (u, v, _) = sides[:2]
    opposite = np.abs(sides[0] + sides[2]).max() <= ROUNDING * size
    if not opposite or abs(x * u + y * v) > ROUNDING * size**2 or x * v >= y * u:
        return (
            "expected the four corners of a rectangle, clockwise as seen from above, got "
            f"{given[:, :2].tolist()}"
        )
    return ""


def check_features(features: FeatureSet, method: str, found: object, *_: object) -> None:
    """Check the array that a method of a feature set returned; further arguments are ignored.

    Args:
        features: The feature set, with k names.
        method: Name of the method: "matrix", whose array must be (k, 6), or "values", "error",
            "known" or "scales", whose array must be (k,).
        found: The returned value.

    Raises:
        BrokenContract: The value is no array of this shape; `known` returned something else than
            booleans; another method returned something else than finite numbers (only `error` may
            return nan); or `scales` returned a number that is not above 0.
    """
    k = len(features.names)
    shape = (k, 6) if method == "matrix" else (k,)
    values = require_array(found, shape, method)
    if method == "known":
        require(values.dtype == np.bool_, "known returned {}; it should be {} flags", values, k)
        return
    fits = values.dtype.kind in "fiu" and is_finite(values)
    if method == "error" and not fits:  # nan is the error of a feature that was not measured
        fits = is_array(values, shape, finite=False) and not np.isinf(values).any()
    require(fits, "{} returned {}; all must be finite real numbers", method, values)
    if method == "scales":
        require((values > 0).all(), "scales returned {}; all must be above 0", values)


def require_array(found: object, shape: tuple[int, ...], method: str) -> Array:
    """Return a value that a component's method returned, unchanged, after checking that it is a
    NumPy array with the required shape; the type of its elements is not checked.

    Args:
        found: The returned value.
        shape: The required shape.
        method: Name of the method, for the message.

    Raises:
        BrokenContract: The value is no NumPy array, or has another shape.
    """
    if isinstance(found, np.ndarray) and found.shape == shape:
        return found
    what = f"an array {found.shape}" if isinstance(found, np.ndarray) else type(found).__name__
    raise BrokenContract(f"{method} returned {what}; return a NumPy array {shape}")


def check_names(features: FeatureSet) -> None:
    """Check the names of a feature set and the properties that belong to them: units, noise,
    feed_forward, and sole_dof (which names the degree of freedom that a feature alone controls).

    Raises:
        BrokenContract: There are no names, or they are not different strings; there are more or
            fewer units or noises than names; feed_forward or sole_dof names an unknown feature; a
            noise is not a finite number above 0; or a value of sole_dof is not one of "vx", "vy",
            "vz", "wx", "wy", "wz".
    """
    names = features.names
    k = len(names)
    require(
        len(set(names)) == k and set(map(type, names)) == {str},
        "names are {}; they must be different texts, at least one",
        names,
    )
    require(
        len(features.units) == k,
        "there are {} names and {} units; give each feature a unit",
        k,
        len(features.units),
    )
    require(
        set(features.feed_forward) <= {*names},
        "feed_forward names features that the set does not have; take only those in names",
    )
    require(
        set(features.sole_dof) <= {*names} and set(features.sole_dof.values()) <= {*DOF},
        "sole_dof has a key that is no feature, or a value that is not one of {}",
        ", ".join(DOF),
    )
    require(
        is_array(features.noise, (k,)) and (features.noise > 0).all(),
        "noise is not an array of {} numbers above 0",
        k,
    )


def check_prediction(method: str, prediction: object, given: Array | OwnMotion, *_: object) -> None:
    """Check the prediction that an estimator returned; further arguments are ignored.

    Args:
        method: Name of the called method: "update", or "skip", which gets no measurement and so has
            no innovation.
        prediction: The returned value.
        given: First argument of the call, from which the number k of features is taken: the error
            (k,) for "update", the camera's own motion for "skip".

    Raises:
        BrokenContract: The value is no `Prediction`, `error` or `motion` is not k finite numbers,
            `innovation` or `nis` is not k numbers (nan is allowed), or the innovation of "skip" is
            not nan.
    """
    p = require_type(prediction, Prediction, method)
    k = len(given.past if isinstance(given, OwnMotion) else given)
    require_fields(p, _prediction_rules(k), f"{method}: ")
    require(
        method == "update" or np.isnan(p.innovation).all(),
        "skip: Prediction.innovation has numbers, but nothing was measured; return nan there, as "
        "Prediction.unmeasured does",
    )


@cache
def _prediction_rules(k: int) -> tuple[Rule, ...]:
    """Return the rules of a `Prediction` of k features."""
    finite = (
        Rule(name, partial(is_array, shape=(k,)), f"it should be {k} finite numbers")
        for name in ("error", "motion")
    )
    measured = (
        Rule(
            name,
            partial(is_array, shape=(k,), finite=False),
            f"it should be {k} numbers, nan for features that were not measured",
        )
        for name in ("innovation", "nis")
    )
    return (*finite, *measured)


@cache
def _trace_rules(k: int) -> tuple[Rule, ...]:
    """Return the rules of a command's `Trace` of k features."""
    return tuple(
        Rule(
            name,
            partial(is_array, shape=(k,), finite=False),
            f"it should be {k} numbers, nan for unknown ones",
        )
        for name in ("features", "error", "scales", "own")
    )


def check_command(command: object, *_: object) -> None:
    """Check the command that a controller returned; further arguments are ignored.

    Raises:
        BrokenContract: The object is no `Command`, one of its fields is invalid, or the arrays
            `features`, `error`, `scales` and `own` of its trace are not (k,) with the same k.
    """
    c = require_type(command, Command, "command")
    require_fields(c, COMMAND)
    if c.trace is not None:
        require_fields(c.trace, _trace_rules(np.size(c.trace.features)))


def check_same_features(command: Command, names: tuple[str, ...]) -> None:
    """Check that a command's trace (its intermediate results) has as many features as the run's
    feature set. A command without a trace is accepted.

    Args:
        command: The command that a controller returned.
        names: Names of the features of the run's feature set.

    Raises:
        BrokenContract: The trace has another number of features.
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
    """Check the pose of the target that a motion returned.

    Args:
        pose: The returned object.
        time: The time for which it was returned [s], for the message.

    Raises:
        BrokenContract: The object is no `Pose`, its translation is not three finite numbers, or its
            matrix (3, 3) is no rotation.
    """
    p = require_type(pose, Pose, "at")
    require_fields(p, POSE)
    require(
        is_rotation(p.rotation, ROUNDING),
        "at({:g}) is no pose: its matrix (3, 3) is no rotation",
        time,
    )


def check_effect(effect: object, time: float) -> None:
    """Check the effect on image, light and scene that a disturbance returned.

    Args:
        effect: The returned object.
        time: The time for which it was returned [s].

    Raises:
        BrokenContract: The object is no `Effect`; a brightness factor (`gain` or `lamp`) is not a
            number from 0 to 1e9; or the effect for a negative time is not `Effect()`, which changes
            nothing.
    """
    e = require_type(effect, Effect, "at")
    require_fields(e, EFFECT)
    require(
        time >= 0 or e == Effect(),
        "its effect begins before time 0; return Effect() for negative times",
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
"""The methods that each component must have, by its place in a scenario, and the check of the value
that each returns."""
FEATURES = ("values", "matrix", "error", "known", "scales")
"""The methods of feature sets; their checks need the set, for its number of features."""


OPTIONAL: Mapping[str, Mapping[str, Check]] = {"tracker": {"outline": check_outline}}
"""Checks of the values that optional methods return, by the component's place in a scenario."""


def _checks_of(place: str, part: object) -> Mapping[str, Check | None]:
    if place == "features":
        features = cast(FeatureSet, part)
        return {name: partial(check_features, features, name) for name in FEATURES}
    return CONTRACTS.get(place, {})


def check_built(place: str, built: object) -> None:
    """Check the component that a `Config` built: its methods and properties, or its type.

    Args:
        place: Name of the component's section in a scenario, such as "tracker".
        built: The component.

    Raises:
        BrokenContract: The component lacks a method that components of its section must have;
            properties of a feature set do not fit its names (see `check_names`); a controller has a
            method `aim`, which would not be called; a disturbance has no tuple `props`; a robot is
            no `Design`, or a target no `Target`; or a target's outline is not the corners of a
            rectangle of one height (see `outline_fault`).
    """
    kind = type(built).__name__
    for name in _checks_of(place, built):
        require(
            callable(getattr(built, name, None)),
            "build returned {}, which has no method {}",
            kind,
            name,
        )
    match place:
        case "features":
            check_names(cast(FeatureSet, built))
        case "controller":
            require(
                not hasattr(built, "aim"),
                "it has a method aim, which is not called: command finds the goal in seen.goal",
            )
        case "disturbances":
            require(
                isinstance(getattr(built, "props", None), tuple),
                "it has no tuple `props`; use () if it needs nothing in the scene",
            )
        case "robot" | "target":
            _check_model(place, built)
        case _:
            pass


def check_sees(place: str, config: object, built: object) -> None:
    """Check that a component has a method `see` if its settings declare in `needs` a channel (a
    kind of data) that only this method delivers, such as `Channel.TRUTH`.

    Args:
        place: Name of the component's section in a scenario, such as "tracker".
        config: The component's settings.
        built: The component.

    Raises:
        BrokenContract: Such a channel is declared, and the component has no method `see`.
    """
    viewed = needs_of(config) - BY_ARGUMENTS.get(place, frozenset(Channel))
    require(
        not viewed or isinstance(built, Sees),
        "its Config needs {}, but it has no method see(view) to take that",
        " and ".join(sorted(channel.name for channel in viewed)),
    )


def _check_model(place: str, built: object) -> None:
    from sim.kinematics.robot import Design
    from sim.models.target import Target  # MuJoCo: not for a tracker alone

    found = require_type(built, Design if place == "robot" else Target, "build")
    if isinstance(found, Target):
        require(
            is_array(found.outline, (4, 3)),
            "the outline is not four corners (4, 3) of finite numbers",
        )
        fault = outline_fault(found.outline)
        require(not fault, "the outline: {}", fault)


def check_followed(features: FeatureSet, estimate: Estimate, goal: Sight) -> None:
    """Check that at least one feature can be measured with what a tracker follows: the target's
    angle, its size, or its corners, which show both. A tracker that follows angle and size always
    passes.

    Args:
        features: The feature set.
        estimate: The tracker's first estimate of a visible target, which says what the tracker
            follows.
        goal: The desired view of the target.

    Raises:
        BrokenContract: No feature can be measured.
    """
    angle, size = (follows or estimate.corners is not None for follows in estimate.follows)
    sight = replace(goal, angle_known=angle, size_known=size)
    missing = " nor ".join(["angle"] * (not angle) + ["size"] * (not size))
    require(
        not missing or features.known(sight).any(),
        "the tracker follows no {} of this target, and without it none of the features is known: "
        "choose another tracker or other features",
        missing,
    )


@final
class _Guarded:
    """A wrapper of a component that checks what its methods return; other attributes pass
    through.
    """

    def __init__(
        self,
        part: object,
        checks: Mapping[str, Check | None],
        blame: Callable[[BaseException, str], None],
    ) -> None:
        self._part = part
        self._checks = checks
        self._blame = blame
        # From Python 3.12 on `isinstance` with a protocol does not ask `__getattr__`.
        for name in dir(type(part)):
            if not name.startswith("_") and callable(getattr(type(part), name)):
                getattr(self, name)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._part, name)
        if not callable(found):
            return found
        check = self._checks.get(name)
        blame = self._blame  # a call that held `self` would make a cycle, and keep the part alive

        def call(*arguments: Any, **named: Any) -> Any:
            try:
                result = found(*arguments, **named)
                if check is not None:
                    check(result, *arguments)
            except BaseException as error:
                blame(error, name)
                raise
            return result

        setattr(self, name, call)  # later calls find it without `__getattr__`
        return call


def _blame_nobody(error: BaseException, method: str) -> None:
    """Let the exception of a component's method pass unchanged."""


def guarded(
    part: Built,
    place: str,
    blame: Callable[[BaseException, str], None] = _blame_nobody,
    *,
    checked: bool = True,
) -> Built:
    """Return a wrapper of a component that checks what the component's methods return: a call that
    returns something invalid raises BrokenContract. All attributes of the component can be used
    through the wrapper.

    Args:
        part: The component that a `Config` built.
        place: Name of its section in a scenario, such as "tracker".
        blame: Called with each exception of a method, also a BrokenContract, and the name of the
            method; it may raise another exception, which names the component. If it returns, the
            original exception is raised.
        checked: False: returned values are not checked; `blame` is still called.
    """
    checks = {**_checks_of(place, part), **OPTIONAL.get(place, {})} if checked else {}
    return cast(Built, _Guarded(part, checks, blame))
