"""Trackers: each estimates where one target is in the frames of a camera.

A tracker is given frames and, where it is known, how the camera's motion changes the picture, but
never the simulated world, except the tracker `truth`. `create` returns one of our trackers by its
kind (name); `wrap` turns a class that was written for OpenCV or GOT-10k into settings (a `Config`
class) that build a tracker with our interface.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.installed import Trusted
from sim.kinds import checked
from tracking.trackers import KINDS

if TYPE_CHECKING:
    from sim.kinds import PartConfig
    from tracking.guests.wrap import wrap
    from tracking.types import Tracker

__all__ = ["create", "wrap"]


def create(kind: str, seed: int = 0, preset: str | None = None, **settings: object) -> Tracker:
    """Return a new tracker of a kind, such as "pf_ssd".

    Args:
        kind: Name of a file in tracking/trackers, a kind of an installed package, or "module:Name"
            for a class of your own.
        seed: Seed of the tracker's random draws.
        preset: Name of one of the kind's presets: "paper" for the settings of the paper that
            describes the tracker, and, for a few kinds, "video" for recordings; None for the
            defaults, the best settings known.
        **settings: Fields of the kind's `Config`; `servobench list KIND` prints them.

    Raises:
        UnknownKind: There is no such kind or preset, and the message lists those that exist; or the
            class that `kind` names cannot be imported or is no tracker.
        TypeError: The kind has no such setting.
        ValueError: The seed is not a whole number of at least 0, or a setting has the wrong type or
            is out of range.

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
        raise ValueError(f"seed = {seed!r}: expected a whole number of at least 0") from None
    return configured(kind, preset, **settings).build(rng)


def configured(kind: str, preset: str | None = None, **settings: object) -> PartConfig[Tracker]:
    """Return the checked `Config` of a tracker, whose method `build(rng)` returns the tracker.

    Args:
        kind: Name of a file in tracking/trackers, a kind of an installed package, or "module:Name"
            for a class of your own.
        preset: Name of one of the kind's presets: "paper" for the settings of the paper that
            describes the tracker, and, for a few kinds, "video" for recordings; None for the
            defaults, the best settings known.
        **settings: Fields of the kind's `Config`; `servobench list KIND` prints them.

    Raises:
        UnknownKind: There is no such kind or preset, and the message lists those that exist; or the
            class that `kind` names cannot be imported or is no tracker.
        TypeError: The kind has no such setting.
        ValueError: A setting has the wrong type, or is out of range.
    """
    return checked(KINDS.config(Trusted(kind), preset, **settings), kind)


def __getattr__(name: str) -> object:
    if name == "wrap":  # its module imports OpenCV, which `create` alone does not need
        from tracking.guests.wrap import wrap

        return wrap
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
