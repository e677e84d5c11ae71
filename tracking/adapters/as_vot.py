"""Our trackers for the VOT toolkit's Python integration."""

import inspect
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from sim.files.picture_file import read_image
from tracking.adapters.follower import Follower
from tracking.sequences.sources import RATE


class VotHandle(Protocol):
    """Interface of `vot.VOT("rectangle")` or `vot.VOT("polygon")` of the toolkit's integration."""

    def region(self) -> Any:
        """Return the target in the first picture: x, y, width, height, or points of x, y."""
        ...

    def frame(self) -> str | None:
        """Return the next picture's path; nothing at the end."""
        ...

    def report(self, region: Any, confidence: float) -> None:
        """Report the target's region to the toolkit; the confidence where it is taken."""
        ...


def run_vot(
    handle: VotHandle, kind: str, seed: int = 0, rate: float = RATE, **settings: Any
) -> None:
    """Follow a target for the VOT toolkit until it gives no more pictures.

    Raises:
        ValueError: A picture cannot be read or decoded, or is too large; or the region is neither a
            rectangle nor four points.
    """
    given = handle.region()
    path = handle.frame()
    if not path:
        return
    points = getattr(given, "points", None)
    box = () if points else (given.x, given.y, given.width, given.height)
    follower = Follower(kind, seed, rate, settings)
    scored = len(inspect.signature(handle.report).parameters) > 1
    region = np.array(points or box, dtype=float).ravel()
    follower.start(read_image(Path(path)), region, turned=True)
    while path := handle.frame():
        found, rect = follower.update(read_image(Path(path)))
        if points is None:
            answer = type(given)(*rect)
        else:
            outline = found.outline(follower.region).tolist()
            answer = type(given)([type(points[0])(*corner) for corner in outline])
        handle.report(answer, *[1.0 - found.distance][: int(scored)])
