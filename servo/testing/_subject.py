"""The part that a check was given, by whatever names it."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from servo.contracts import BrokenContract, check_built, guarded
from servo.scenario.catalogue import LISTS, PLUGINS
from sim.installed import Trusted
from sim.kinds import UnknownKind

T = TypeVar("T")
REGISTRIES = {place: registry for place, (registry, _) in PLUGINS.items()} | LISTS
"""The kinds of each part, by its place in a scenario."""
REMEMBERS = "a second start did not forget the first; reset in start all that a run changes"


def contract(check: Callable[..., None]) -> Callable[..., None]:
    """Make an exception of the part itself a sentence of the check."""

    @functools.wraps(check)
    def checked(*part: Any, **more: Any) -> None:
        try:
            check(*part, **more)
        except BrokenContract:
            raise
        except (Exception, SystemExit) as error:
            raise BrokenContract(f"it raised {type(error).__name__}: {error}") from error

    return checked


def config_of(place: str, part: Any) -> Any:
    """Return the `Config` instance of what a check was given.

    Args:
        place: The part's place in a scenario, such as "tracker".
        part: Its `Config` (class or instance), the name of its kind, or "module:Name".

    Raises:
        BrokenContract: It is no part of this kind.
    """
    if dataclasses.is_dataclass(part) and not isinstance(part, type):
        return part
    registry = REGISTRIES[place]
    try:
        if isinstance(part, str):
            return registry.config_of(Trusted(part))()
        return registry.as_config(part, getattr(part, "__qualname__", repr(part)))()
    except UnknownKind as error:
        raise BrokenContract(str(error)) from error


def built(place: str, config: Any, given: Any = None) -> Any:
    """Return what a `Config` builds; its calls are checked.

    Args:
        place: The part's place in a scenario, such as "tracker".
        config: Its `Config`.
        given: What it is built from; None: a generator of random numbers, the same each time.

    Raises:
        BrokenContract: It lacks what its kind has.
    """
    found = config.build(np.random.default_rng(0) if given is None else given)
    check_built(place, found)
    return found if place in ("robot", "target") else guarded(found, place)


def used_twice(place: str, config: Any, use: Callable[[Any], T]) -> tuple[T, T]:
    """Return what a part gives when it is used, and used again as the loop does for a second run:
    its generator of random numbers is then as it was after `build`.
    """
    rng = np.random.default_rng(0)
    part = built(place, config, rng)
    state = rng.bit_generator.state
    first = use(part)
    rng.bit_generator.state = state
    return first, use(part)
