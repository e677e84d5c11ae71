"""Conventions of other trackers: their pictures, boxes and answers.

| | OpenCV | GOT-10k |
|---|---|---|
| picture | BGR | RGB |
| box | integers x, y, width, height, pixels counted from 0 | array (4,), pixels counted from 1 |
| answer of `update` | (ok, box) or a box | a box |
"""

import inspect
import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.external.boxes import Box, box_of
from tracking.types import FARTHEST, Region, State

Convention = Literal["opencv", "got10k"]
Score = str | Callable[[Any], float]
"""Attribute or method of a tracker that gives its score, or a function of the tracker."""
SLACK = 1e-3
"""A score may leave 0..1 by this much: single precision adds up to that."""
EXPECTED = "(ok, box) or a box of x, y, width, height"
BOXES = {"box", "bbox"}
"""Conventions of the second argument of `init` in GOT-10k's convention."""


class Foreign(Protocol):
    """A tracker in one of the conventions."""

    def init(self, image: Any, box: Any, /) -> Any:
        """Learn the target in a box; False refuses it."""
        ...

    def update(self, image: Any, /) -> Any:
        """Return the target's box in the next picture."""
        ...


@dataclass(frozen=True, slots=True)
class Caller:
    """A tracker of boxes that is called in its convention."""

    tracker: Foreign
    convention: Convention
    name: str
    """Name of the tracker, for messages."""
    score_of: Score | None

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Show the first picture with the target's box, and return the box.

        Raises:
            ValueError: The tracker refuses by returning False.
        """
        box = box_of(region, state, image)
        given = box if self.convention == "opencv" else np.array(box, dtype=float) + (1, 1, 0, 0)
        if self.tracker.init(self._picture(image), given) is False:
            raise ValueError(f"{self.name}: init refused the region x, y, width, height = {box}")
        return box

    def update(self, image: Image) -> Array | None:
        """Return the target's box (4,) in the next picture [px]; None where it is not seen.

        Raises:
            ValueError: The tracker returned something else.
        """
        box = box_in(self.tracker.update(self._picture(image)), self.name)
        return box if box is None or self.convention == "opencv" else box - (1, 1, 0, 0)

    def score(self) -> float:
        """Return the tracker's own score, 0..1.

        Raises:
            ValueError: It is not there, or not between 0 and 1.
        """
        if callable(self.score_of):
            return score_in(self.score_of(self.tracker), self.name)
        name = str(self.score_of)
        if not hasattr(self.tracker, name):
            raise ValueError(f"{self.name} has no '{name}', which is to give its score")
        found = getattr(self.tracker, name)
        return score_in(found() if callable(found) else found, self.name)

    def _picture(self, image: Image) -> Image:
        """Return a picture that the tracker may keep and write to."""
        if self.convention == "opencv":
            return cv2.cvtColor(image, cv2.COLOR_RGB2BGR).astype(np.uint8, copy=False)
        return np.array(image, order="C")


def convention_of(tracker: Foreign) -> Convention:
    """Return the convention of a tracker: GOT-10k's for a subclass of its toolkit's `Tracker`, and
    where the second argument of `init` is named box or bbox; else OpenCV's.
    """
    if any(base.__module__.startswith("got10k.") for base in type(tracker).__mro__):
        return "got10k"
    try:
        names = list(inspect.signature(tracker.init).parameters)
    except (TypeError, ValueError):  # compiled, such as OpenCV's own
        return "opencv"
    return "got10k" if BOXES & set(names[1:2]) else "opencv"


def box_in(answer: Any, name: str) -> Array | None:
    """Return the box (4,) in an answer of `update`; None for ok = False, or a box of zeros.

    Raises:
        ValueError: It is something else; the message names the tracker and what it returned.
    """
    given = answer
    if isinstance(answer, tuple | list) and len(answer) == 2 and np.ndim(answer[0]) == 0:
        ok, given = answer
        if not ok:
            return None
    try:
        box = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        box = np.empty(0)
    if box.shape == (4,) and not box.any():
        return None
    if box.shape != (4,) or not (np.abs(box) <= FARTHEST).all():  # nan is not
        raise ValueError(f"{name}: update returned {shown(answer)}; {EXPECTED} is expected")
    if not (box[2:] > 0).all():
        raise ValueError(f"{name}: update returned {shown(answer)}, a box without an area")
    return box


def score_in(answer: Any, name: str) -> float:
    """Return a tracker's score, kept within 0..1.

    Raises:
        ValueError: It is none; the message names the tracker and its score.
    """
    try:
        score = float(answer)
    except (TypeError, ValueError):
        score = float("nan")
    if not -SLACK <= score <= 1 + SLACK:
        raise ValueError(f"{name}: the score is {shown(answer)}; a score lies between 0 and 1")
    return min(max(score, 0.0), 1.0)


def shown(answer: Any) -> str:
    """Return a tracker's answer on one short line."""
    return " ".join(reprlib.repr(answer).split())
