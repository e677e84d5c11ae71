"""Trackers, one a file, named as in the literature: `Config.build(rng)` gives a `Tracker`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from tracking.types import Tracker


def _adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a class or object with `init` and `update`, or a function that
    makes one; None for anything else.
    """
    # Imported only now: `servobench list` only looks at files.
    from tracking.wrapped.wrap import is_foreign, wrap

    is_function = callable(found) and not isinstance(found, type)
    return wrap(found) if is_foreign(found) or is_function else None


KINDS: Kinds[PartConfig[Tracker]] = Kinds(__name__, "servobench.trackers", _adapted)
