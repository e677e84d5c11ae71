"""A part of a run that raised an exception, or gave something that has no meaning, by its name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np

from servo.mistake import Mistake
from servo.types import Command
from sim.kinds import kind_of
from sim.robot import Design
from sim.target import Target
from sim.world import Unstable
from tracking.types import Estimate, Status

Item = TypeVar("Item")


class PartFailed(Mistake):
    """A sentence that names the part; the exception that it raised is the cause."""

    @staticmethod
    def by(part: str, config: Any, what: str) -> PartFailed:
        """Build it from the part's place in the scenario, its `Config` and what it did."""
        return PartFailed(f"{part} '{kind_of(config)}': {what}")


ENDS = (KeyboardInterrupt, GeneratorExit, MemoryError)
"""What ends a run from outside, whatever part is at work."""
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
    what, kind = part.partition("[")[0], type(built).__name__
    wanted = TYPES.get(what)
    if wanted is not None and not isinstance(built, wanted):
        raise PartFailed.by(part, config, f"build returned {kind} instead of a {wanted.__name__}")
    for name in METHODS.get(what, ()):
        if not callable(getattr(built, name, None)):
            raise PartFailed.by(part, config, f"build returned {kind}, which has no method {name}")
    if isinstance(built, Target) and not np.isfinite(built.outline).all():
        raise PartFailed.by(part, config, "its reference rectangle is not finite")
    return built


def part_failed(error: BaseException, parts: Mapping[str, tuple[Any, ...]]) -> PartFailed | None:
    """Find the part whose code an exception came through last; None where it was none.

    Args:
        error: The exception, with its traceback.
        parts: By place in the scenario, such as "tracker": the `Config`, and what it built.
    """
    if isinstance(error, Unstable):
        return PartFailed.by("robot", parts["robot"][0], str(error))
    modules = {module: name for name, part in parts.items() for module in _modules(part)}
    classes = {_class_of(item): name for name, part in parts.items() for item in part}
    trace, in_module, in_class = error.__traceback__, None, None
    while trace is not None:
        module = trace.tb_frame.f_globals.get("__name__", "")
        in_module = modules.get(module, in_module)
        # Several parts may share a module: their classes tell them apart.
        of = trace.tb_frame.f_code.co_qualname.rpartition(".")[0]
        in_class = classes.get((module, of), in_class)
        trace = trace.tb_next
    found = in_class or in_module
    if isinstance(error, (Mistake, *ENDS)) or found is None:
        return None
    kind, text = type(error).__name__, str(error)
    what = text if isinstance(error, ValueError) and text else f"{kind}: {text}".removesuffix(": ")
    return PartFailed.by(found, parts[found][0], what)


def naming_parts(items: Iterable[Item], parts: Mapping[str, tuple[Any, ...]]) -> Iterator[Item]:
    """Items one by one; what a part refuses, or an exception of its own, is a sentence.

    Raises:
        Mistake: A ValueError, or an exception of a part's code.
    """
    try:
        yield from items
    except BaseException as error:
        if isinstance(error, ValueError) and not isinstance(error, Mistake):
            raise Mistake(str(error)) from None
        failed = part_failed(error, parts)
        if failed is None:
            raise
        raise failed from error


def _class_of(item: Any) -> tuple[str, str]:
    return type(item).__module__, type(item).__qualname__


def _modules(part: tuple[Any, ...]) -> set[str]:
    """Modules with the code of a part: of its objects, and of a class that an adapter wraps."""
    named = kind_of(part[0]).partition(":")[0]
    return {named, *(type(item).__module__ for item in part)}


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


def check_command(command: Any, parts: Mapping[str, tuple[Any, ...]]) -> Command:
    """Refuse a command that no robot can follow, and name the part that gave the numbers.

    Raises:
        PartFailed: It is no `Command`, or a number in it is not finite.
    """
    config = parts["controller"][0]
    if not isinstance(command, Command):
        what = f"command returned {type(command).__name__} instead of a Command"
        raise PartFailed.by("controller", config, what)
    if np.shape(command.twist) == (6,) and np.isfinite(command.twist).all():
        return command
    if (trace := command.trace) is not None:
        given = {"features": trace.error, "estimator": trace.prediction.error}
        for part, values in given.items():
            if not np.isfinite(values).all():
                raise PartFailed.by(part, parts[part][0], f"gave the values {np.array(values)}")
    what = f"the twist is {np.array(command.twist)}; it should be six finite numbers"
    raise PartFailed.by("controller", config, what)
