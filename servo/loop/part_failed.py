"""The part of a run that an exception came from, by its name."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from servo.mistake import Mistake
from sim.kinds import kind_of

Item = TypeVar("Item")


class PartFailed(Mistake):
    """A sentence that names the part; the exception that it raised is the cause."""

    @staticmethod
    def by(part: str, config: Any, what: str) -> PartFailed:
        """Build it from the part's place in the scenario, its `Config` and what it did."""
        kind = kind_of(config)  # a wrapped tracker begins its messages with its own name
        return PartFailed(f"{part} '{kind}': {what.removeprefix(f'{kind}: ')}")


ENDS = (KeyboardInterrupt, GeneratorExit, MemoryError)
"""What ends a run from outside, whatever part is at work."""


def part_failed(error: BaseException, parts: Mapping[str, tuple[Any, ...]]) -> PartFailed | None:
    """Find the part whose code an exception came through last; None where it was none.

    Args:
        error: The exception, with its traceback.
        parts: By place in the scenario, such as "tracker": the `Config`, and what it built.
    """
    modules = {module: name for name, part in parts.items() for module in _modules(part)}
    classes = {_class_of(item): name for name, part in parts.items() for item in part}
    trace = error.__traceback__
    in_module = None
    in_class = None
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
    kind = type(error).__name__
    text = str(error)
    what = text if isinstance(error, ValueError) and text else f"{kind}: {text}".removesuffix(": ")
    return PartFailed.by(found, parts[found][0], what)


def naming_parts(items: Iterable[Item], parts: Mapping[str, tuple[Any, ...]]) -> Iterator[Item]:
    """Items one by one; what a part refuses, or an exception of its own, is a sentence.

    Raises:
        Mistake: A ValueError, or an exception of a part's code.
    """
    with parts_named(parts):
        try:
            yield from items
        except Mistake:
            raise
        except ValueError as error:
            raise Mistake(str(error)) from None


def _class_of(item: Any) -> tuple[str, str]:
    return type(item).__module__, type(item).__qualname__


def _modules(part: tuple[Any, ...]) -> set[str]:
    """Modules with the code of a part: of its objects, and of a class that an adapter wraps."""
    named = kind_of(part[0]).partition(":")[0]
    return {named, *(type(item).__module__ for item in part)}


@contextmanager
def parts_named(parts: Mapping[str, tuple[Any, ...]]) -> Generator[None]:
    """Turn an exception of a part's code into a sentence that names the part.

    Args:
        parts: Each part's `Config`, and what that built if it is there yet; by name.
    """
    try:
        yield
    except BaseException as error:
        failed = part_failed(error, parts)
        if failed is None:
            raise
        raise failed from error
