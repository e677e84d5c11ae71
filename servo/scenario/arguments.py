"""Checks of the arguments of servobench's Python functions; a wrong argument raises a `Mistake`
with one sentence.

In each function `given` is the argument as the caller passed it, and `what` the argument's name in
that sentence.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from servo.mistake import Mistake, unknown
from sim.types import Array


def name(given: object, what: str) -> str:
    """Return the name or path of a scenario, a study or a folder as text.

    Args:
        given: A text or a `Path`.
        what: What it names, such as "scenario", for the message.

    Raises:
        Mistake: `given` is neither a text nor a `Path`.
    """
    if not isinstance(given, str | Path):
        raise Mistake(f"a {what} is given by its name or path, not by {type(given).__name__}")
    return str(given)


def texts(given: object) -> tuple[str, ...]:
    """Return a list (or other iterable) of changes of settings, such as ["run.duration=5"], as a
    tuple. The texts are not parsed here.

    Raises:
        Mistake: `given` is not a list of texts.
    """
    if isinstance(given, Iterable) and not isinstance(given, str | Mapping):
        found: tuple[object, ...] = tuple(given)
        changes = tuple(item for item in found if isinstance(item, str))
        if len(changes) == len(found):
            return changes
    such = given if isinstance(given, str) else "run.duration=5"
    raise Mistake(f"{given!r}: expected a list of changes, such as [{such!r}]")


def whole(given: object, what: str, least: int) -> int:
    """Return a whole number of Python or NumPy as an `int`.

    Args:
        given: The number.
        what: Name of the argument, for the message.
        least: Smallest allowed number.

    Raises:
        Mistake: `given` is no whole number (also if it is True or False), or is below `least`.
    """
    if isinstance(given, bool) or not isinstance(given, int | np.integer) or given < least:
        raise Mistake(f"{what} = {given!r}: expected a whole number from {least} on")
    return int(given)


def numbers(given: object, what: str, count: int) -> Array:
    """Return finite numbers as an array (count,) of floats.

    Args:
        given: The numbers, such as a list or an array.
        what: Name of the argument, for the message.
        count: Required number of numbers.

    Raises:
        Mistake: `given` has another shape, or a value that is not finite.
    """
    try:
        found = np.array(given, dtype=float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise Mistake(f"{what}: expected {count} finite numbers, got {given!r}")
    return found


def one_of(given: object, what: str, known: Sequence[object]) -> None:
    """Check that a choice is one of the known ones.

    Args:
        given: The choice.
        what: Name of the argument, for the message.
        known: The choices there are.

    Raises:
        Mistake: `given` is not among `known`; the message names the most similar choice, or all
            choices if none is similar.
    """
    if given not in known:
        raise Mistake(unknown(str(given), [str(k) for k in known], what))


def each_once(given: object, what: str, known: Sequence[str]) -> list[int]:
    """Return the index in `known` of each item in a list of choices, in the order of the list.

    Args:
        given: The list of choices.
        what: Name of the argument, for the message.
        known: The choices there are.

    Raises:
        Mistake: `given` is empty or not a list, or an item is unknown or chosen twice.
    """
    chosen: list[str] = []
    if isinstance(given, Iterable) and not isinstance(given, str):
        chosen += given
    if not chosen or any(chosen.count(item) > 1 for item in chosen):
        some = ", ".join(known)
        raise Mistake(f"{what} = {given!r}: expected a list of some of {some}, each once")
    for item in chosen:
        one_of(item, what, known)
    return [known.index(item) for item in chosen]
