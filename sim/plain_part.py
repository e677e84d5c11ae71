"""Settings of a component (a tracker, a motion, ...) that has no `Config`: the arguments of its
class or function that have a default.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Hashable, Mapping
from dataclasses import make_dataclass
from typing import TYPE_CHECKING, Any

from sim.kinds import ConfigClass

if TYPE_CHECKING:
    import numpy as np  # `servobench list` only looks at files

RESERVED = ("kind", "preset", "build", "self")
"""Names that a table of settings, or a `Config`, has for something else."""
DRAWN: dict[str, Callable[[np.random.Generator], Any]] = {
    "rng": lambda rng: rng,
    "seed": lambda rng: int(rng.integers(1 << 31)),
}
"""Arguments that are no settings: random numbers that the run gives."""


def config_for(part: object, make: Callable[..., object], **attributes: object) -> ConfigClass:
    """Make a `Config` class (a dataclass of settings with a method `build`) for a component that is
    given as a class, a function, or an object.

    Args:
        part: The component. The settings are the arguments of a class or function with a hashable
            default, except kind, preset, build, self, rng and seed; an object has no settings.
        make: Function that returns the component; it gets the settings by name, and `rng` or `seed`
            if `part` has an argument of that name.
        **attributes: Further attributes of the `Config` class.
    """
    taken: Mapping[str, inspect.Parameter] = {}
    if isinstance(part, type) or inspect.isfunction(part):
        taken = inspect.signature(part).parameters
    drawn = [name for name in DRAWN if name in taken]

    def build(self: object, rng: np.random.Generator) -> object:
        return make(**vars(self), **{name: DRAWN[name](rng) for name in drawn})

    of: Any = part if hasattr(part, "__qualname__") else type(part)
    fields = [(name, _type_of(value), value) for name, value in _settings_of(taken).items()]
    members = {"build": build, "kind": f"{of.__module__}:{of.__qualname__}", **attributes}
    return make_dataclass("Config", fields, namespace=members, frozen=True)


def has_methods(part: object, *names: str) -> bool:
    """Return True if a class or an object has a method (or other callable) of each of the given
    names.
    """
    return all(callable(getattr(part, name, None)) for name in names)


def plain_config(part: object, *methods: str) -> ConfigClass | None:
    """Return a `Config` class (a dataclass of settings with a method `build`) for a class or an
    object that has the given methods; None if it lacks one. `build` returns a new instance of a
    class, made with the settings, and an object as it is.
    """
    if not has_methods(part, *methods):
        return None
    return config_for(part, part if isinstance(part, type) else lambda: part)


def _settings_of(taken: Mapping[str, inspect.Parameter]) -> dict[str, object]:
    """Return the arguments that become settings, by name with their defaults: those with a hashable
    default whose names are not reserved.
    """
    closed = {*RESERVED, *DRAWN}
    open_to_all = [p for p in taken.values() if p.default is not p.empty and p.name not in closed]
    return {p.name: p.default for p in open_to_all if isinstance(p.default, Hashable)}


def _type_of(default: object) -> object:
    """Return the type of a setting by its default value: bool or str for one of these, `int |
    float` for any number, and Any for other values.
    """
    of = type(default)
    return int | float if of in (int, float) else of if of in (bool, str) else Any
