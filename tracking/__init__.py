"""Frames in, estimates out: trackers put together from shared parts.

They see frames, never the world behind them. `create` gives a tracker by its kind.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim import plugins
from tracking.types import Tracker

__all__ = ["create"]


def create(kind: str, seed: int = 0, **settings: Any) -> Tracker:
    """A tracker by its kind, such as "pf_ssd", with any of its settings.

    Args:
        kind: A file of tracking/trackers.
        seed: Of the tracker's random draws.
        **settings: Fields of its `Config`; `servobench list KIND` prints them.

    Raises:
        UnknownKind: There is no such kind; the message lists what there is.
        TypeError: There is no such setting.
    """
    config = plugins.config_of("tracking.trackers", kind)(**settings)
    return config.build(np.random.default_rng(seed))
