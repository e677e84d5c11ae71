"""A control law without a `Config`: a class with `start`, `aim` and `command`, or a function.

A function is called as law(seen, task) for each picture in which the target is seen, and returns
the twist (6,) or a `Command`; the camera stands still in the others. Arguments with a default are
the settings of such a law.
"""

import inspect
from collections.abc import Callable, Hashable
from dataclasses import asdict, make_dataclass, replace
from typing import Any, final

import numpy as np

from servo.parts import Task
from servo.types import Command, Mode, Sight
from sim.types import Array, Posture

Law = Callable[..., Array | Command]
TAKEN = ("kind", "preset", "build", "self")
"""Names that a table of settings, or a `Config`, has for something else."""


def adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a law of one's own; None for what is none."""
    has_methods = callable(getattr(found, "command", None))
    if has_methods and not isinstance(found, type):
        return _config_of(found, lambda: found, {})
    if has_methods:
        return _config_of(found, found, _settings_of(found))
    if not inspect.isfunction(found):
        return None
    return _config_of(found, lambda **given: FunctionLaw(found, given), _settings_of(found))


def _config_of(law: Any, make: Callable[..., Any], settings: dict[str, Any]) -> type[Any]:
    def build(self: Any, rng: np.random.Generator) -> Any:
        del rng
        return make(**asdict(self))

    of = law if hasattr(law, "__qualname__") else type(law)
    fields = [(name, _type_of(value), value) for name, value in settings.items()]
    members = {"build": build, "kind": f"{of.__module__}:{of.__qualname__}"}
    return make_dataclass("Config", fields, namespace=members, frozen=True)


def _settings_of(law: Callable[..., Any]) -> dict[str, Any]:
    """Return the arguments that can be settings, and their defaults; others stay as they are."""
    taken = inspect.signature(law).parameters.values()
    open_to_all = [p for p in taken if p.default is not p.empty and p.name not in TAKEN]
    return {p.name: p.default for p in open_to_all if isinstance(p.default, Hashable)}


def _type_of(default: Any) -> Any:
    """Return the type of a setting; a number may be whole or not, whatever its default is."""
    of = type(default)
    return int | float if of in (int, float) else of if of in (bool, str) else Any


@final
class FunctionLaw:
    """A function as a controller."""

    def __init__(self, law: Law, settings: dict[str, Any]) -> None:
        """Take the function, and its arguments besides `seen` and `task`."""
        self._law = law
        self._settings = settings

    def start(self, task: Task) -> None:
        """Begin a task."""
        self._task = task

    def aim(self, goal: Sight) -> None:
        """Go on with another goal."""
        self._task = replace(self._task, goal=goal)

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return what the function asks for; without a target, no motion."""
        if seen is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        asked = self._law(seen, self._task, **self._settings)
        return asked if isinstance(asked, Command) else Command(np.asarray(asked, float))
