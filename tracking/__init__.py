"""Frames in, estimates out: trackers put together from shared parts.

They see frames, never the world behind them. `create` gives a tracker by its kind, `wrap` makes one
of a class with another convention.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sim.installed import Trusted
from sim.kinds import checked
from tracking.trackers import KINDS

if TYPE_CHECKING:
    from tracking.types import Tracker
    from tracking.wrapped.wrap import wrap

__all__ = ["create", "wrap"]


def create(kind: str, seed: int = 0, preset: str | None = None, **settings: Any) -> Tracker:
    """Return a tracker of a kind, such as "pf_ssd", with any of its settings.

    Args:
        kind: A file of tracking/trackers, a kind of an installed package, or "module:Name".
        seed: Seed of the tracker's random draws.
        preset: "paper" for the settings of the paper it comes from; None for the best ones known.
        **settings: Fields of its `Config`; `servobench list KIND` prints them.

    Raises:
        UnknownKind: There is no such kind or preset; the message lists what there is.
        TypeError: There is no such setting.
        ValueError: A setting has a wrong type, or is out of range.

    Example:
        >>> import numpy as np
        >>> from sim.types import Frame
        >>> from tracking.types import Region, State
        >>> image = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
        >>> tracker = create("mk_ssd")
        >>> tracker.start(Frame(image, 0.0, 0), Region(40.0, 30.0), State(80.0, 60.0))
        >>> tracker.update(Frame(image, 0.03, 1)).status.name
        'LOCKED'
    """
    import numpy as np  # not before it is needed: `servobench list` only looks at files

    try:
        rng = np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise ValueError(f"seed = {seed!r}: expected a whole number from 0 on") from None
    return configured(kind, preset, **settings).build(rng)


def configured(kind: str, preset: str | None = None, **settings: Any) -> Any:
    """Return the settings of a tracker, whose method `build` makes it; arguments and errors are
    those of `create`.
    """
    return checked(KINDS.config(Trusted(kind), preset, **settings), kind)


def __getattr__(name: str) -> Any:
    if name == "wrap":  # imported with what it needs, and only then
        from tracking.wrapped.wrap import wrap

        return wrap
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
