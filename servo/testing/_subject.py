"""Builds the component that a check is given, and has the checks that all kinds of components
share.
"""

import dataclasses
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

import numpy as np

from servo.contracts import BrokenContract, check_built, guarded, require
from servo.scenario.catalogue import LISTS, PLUGINS
from sim.installed import Trusted
from sim.kinds import UnknownKind

REGISTRIES = {place: registry for place, (registry, _) in PLUGINS.items()} | LISTS
"""The kinds of each component, by the component's table in a scenario."""
DRAWS = "the second time; draw random numbers from the generator given to build(rng) only"
REMEMBERS = "a second start did not forget the first; reset in start all that a run changes"


@contextmanager
def raising(what: str) -> Generator[None]:
    """Turn an exception that the tested component raises in the block, or in a decorated function,
    into `BrokenContract`; `what` begins its sentence, such as "the component raised".
    """
    try:
        yield
    except BrokenContract:
        raise
    except (Exception, SystemExit) as error:
        raise BrokenContract(f"{what} {type(error).__name__}: {error}") from error


contract = raising("the component raised")
"""Decorator of a check: an exception that the tested component raises becomes `BrokenContract`."""


def config_of(place: str, part: object) -> Any:
    """Return the `Config` instance of the component that a check was given.

    Args:
        place: The component's table in a scenario, such as "tracker".
        part: Its `Config` (class or instance), the name of its kind, or "module:Name".

    Raises:
        BrokenContract: There is no such kind, or the object is no `Config`.
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


def built(place: str, config: Any, given: object = None) -> Any:
    """Build a component, and return it in a wrapper that checks the results of its methods; a robot
    or target, which has no such methods, is returned without a wrapper.

    Args:
        place: The component's table in a scenario, such as "tracker".
        config: The component's `Config`.
        given: Argument of the `Config`'s method `build`; None: a random generator with a fixed
            seed.

    Raises:
        BrokenContract: The component lacks a method, or has the wrong type.
    """
    found = config.build(np.random.default_rng(0) if given is None else given)
    check_built(place, found)
    return found if place in ("robot", "target") else guarded(found, place)


def check_repetition(place: str, config: object, use: Callable[[Any], Any], what: str) -> None:
    """Check that a component gives the same results when it is built again, and also when the same
    object is started for a second run.

    Args:
        place: The component's table in a scenario, such as "tracker".
        config: The component's `Config`.
        use: Function that starts the component and returns its results.
        what: Beginning of the message, such as "the same pictures gave other states".

    Raises:
        BrokenContract: The results differ.
    """
    rng = np.random.default_rng(0)
    part = built(place, config, rng)
    state = rng.bit_generator.state
    first = use(part)
    require(np.array_equal(first, use(built(place, config))), f"{what} {DRAWS}")
    rng.bit_generator.state = state  # as the loop does before each start
    require(np.array_equal(first, use(part)), REMEMBERS)
