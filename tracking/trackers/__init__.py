"""Trackers, one a file, named as in the literature: `Config.build(rng)` gives a `Tracker`."""

from typing import Any

from sim.kinds import Kinds


def _adapted(found: Any) -> type[Any] | None:
    """A `Config` class for a class or object with `init` and `update`, or a function that makes
    one; None for anything else.
    """
    from tracking.external.wrapped import wrap  # only now: `servobench list` looks at files only

    is_function = callable(found) and not isinstance(found, type)
    follows = all(callable(getattr(found, method, None)) for method in ("init", "update"))
    return wrap(found) if follows or is_function else None


KINDS = Kinds[Any](__name__, "servobench.trackers", _adapted)
