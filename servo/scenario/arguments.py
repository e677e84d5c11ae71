"""Checks of the arguments of callers in Python; each error is one sentence."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from servo.mistake import Mistake, unknown
from sim.types import Array


def name(given: Any, what: str) -> str:
    """Return the name or the file of a scenario, a study or a folder.

    Raises:
        Mistake: `given` is neither a text nor a path.
    """
    if not isinstance(given, str | Path):
        raise Mistake(f"a {what} is given by its name or its file, not by {type(given).__name__}")
    return str(given)


def texts(given: Any) -> tuple[str, ...]:
    """Return changes of settings as for --set.

    Raises:
        Mistake: `given` is not a list of texts.
    """
    single = isinstance(given, str | Mapping) or not isinstance(given, Iterable)
    found: tuple[Any, ...] = () if single else tuple(given)
    if single or not all(isinstance(item, str) for item in found):
        such = given if isinstance(given, str) else "run.duration=5"
        raise Mistake(f"{given!r}: expected a list of changes, such as [{such!r}]")
    return found


def whole(given: Any, what: str, least: int) -> int:
    """Return a whole number, of Python or NumPy.

    Raises:
        Mistake: `given` is not a whole number, or is below `least`.
    """
    if isinstance(given, bool) or not isinstance(given, int | np.integer) or given < least:
        raise Mistake(f"{what} = {given!r}: expected a whole number from {least} on")
    return int(given)


def numbers(given: Any, what: str, count: int) -> Array:
    """Return finite numbers (count,).

    Raises:
        Mistake: `given` has another shape, or a value that is not finite.
    """
    try:
        found = np.asarray(given, float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise Mistake(f"{what}: expected {count} finite numbers, got {given!r}")
    return found


def one_of(given: Any, what: str, known: Sequence[Any]) -> None:
    """Refuse a choice that is unknown.

    Raises:
        Mistake: `given` is not among `known`.
    """
    if given not in known:
        raise Mistake(unknown(str(given), [str(k) for k in known], what))


def each_once(given: Any, what: str, known: Sequence[str]) -> list[int]:
    """Return the positions of the chosen ones among all.

    Raises:
        Mistake: `given` is empty or not a list, or an item is unknown or chosen twice.
    """
    chosen = [] if isinstance(given, str) or not isinstance(given, Iterable) else list(given)
    if not chosen or any(chosen.count(item) > 1 for item in chosen):
        some = ", ".join(known)
        raise Mistake(f"{what} = {given!r}: expected a list of some of {some}, each once")
    for item in chosen:
        one_of(item, what, known)
    return [known.index(item) for item in chosen]
