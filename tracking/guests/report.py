"""The report of another author's tracker for a picture (box, angle, corners, seen, confidence),
read from the forms in which trackers answer.
"""

import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, cast, get_args

import cv2
import numpy as np

from sim.types import Array
from tracking.types import FARTHEST, Region, State

Gives = Literal["size", "angle", "corners"]
"""What a tracker may declare that it measures, besides the centre of its box."""
KEYS = ("box", "angle", "corners", "seen", "confidence")
"""Keys of a report that is written as a mapping, such as in JSON."""
DIGITS = 6
"""Decimals that are kept of a number in px: protocols that write numbers as text, or add and
subtract 1 px, then give the same report as a call in the same process."""
SLACK = 1e-3
"""A confidence may leave 0..1 by this much: rounding errors of single precision."""
LEAST_SIDE = 1e-6
"""Shortest side of a box with an area [px]: the product of shorter sides could underflow to 0."""
NUMBERS = "iuf"
"""Kinds of NumPy's types that are numbers, and neither truth values nor texts."""
UPRIGHT = 1e-3
"""Largest deviation of an upright rectangle's sides from the axes, over its longest side."""


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """Where a tracker of another author finds the target in a picture: an upright box (4,) of left,
    top, width, height [px], or one turned by an angle [rad], or four corners (4, 2) [px]; whether
    it sees the target; and its confidence, 0..1. None: not reported.

    Positions are measured from the image's top left corner, and rounded to a millionth of a pixel.
    """

    box: Array | None = None
    """Left, top, width, height (4,) [px]; None where `corners` are reported, or nothing is seen."""
    angle: float | None = None
    """Angle by which the box is turned about its centre, from +x towards +y [rad]; None: the box is
    upright, and the tracker measures no angle."""
    corners: Array | None = None
    """The target's four corners (4, 2) [px], around the target from any corner on, in either
    sense."""
    seen: bool = True
    """Whether the tracker sees the target, by its own account, whatever its confidence."""
    confidence: float | None = None
    """How sure the tracker is, from 0 (lost) to 1 (certain); None: it does not say."""


UNSEEN = Report(seen=False)
"""The report that the target is not seen."""


def report_in(answer: object, name: str) -> Report:
    """Return the report in an answer of a tracker.

    Args:
        answer: A box of left, top, width, height [px]; (ok, box), as OpenCV's trackers return; or a
            mapping with some of the keys box, angle, corners, seen and confidence. A box of zeros,
            or ok = False, means that the target is not seen.
        name: Name of the tracker, to begin messages.

    Raises:
        ValueError: The answer has another form, or a number that is out of range.
    """
    if isinstance(answer, Mapping):
        return _of_mapping(cast("Mapping[object, object]", answer), name)
    given = answer
    if isinstance(answer, tuple | list) and len(answer) == 2 and np.ndim(answer[0]) == 0:
        ok, given = answer
        if not isinstance(ok, bool | int | np.bool_ | np.integer):
            raise ValueError(
                f"{name} answered (ok, box) with {shown(ok)} as ok; it must be True or False"
            )
        if not ok:
            return UNSEEN
    box = _numbers(given, (4,))
    if box is None or not (_has_area(box) or not box.any()):
        raise ValueError(
            f"{name} answered {shown(answer)}; expected a box of left, top, width, height [px] "
            f"(finite numbers up to {FARTHEST:g}, with an area, or all zeros: not seen), (ok, "
            f"box), or a mapping with some of the keys {', '.join(KEYS)}"
        )
    return report_of_box(box)


def report_of_box(box: Array, angle: float | None = None) -> Report:
    """Return the report of a box (4,) of left, top, width, height [px], turned about its centre by
    an angle [rad] (None: upright, not measured); a box of zeros means that the target is not seen.
    """
    return Report(box=box.round(DIGITS), angle=angle) if box.any() else UNSEEN


def report_of_corners(corners: Array) -> Report:
    """Return the report of the four corners (4, 2) [px] of a quadrilateral. Those of an upright
    rectangle are reported as its box, because they show neither angle nor tilt.
    """
    if is_upright(corners):
        return Report(box=box_around(corners).round(DIGITS))
    return Report(corners=corners.round(DIGITS))


def gives_in(declared: object, name: str) -> frozenset[Gives] | None:
    """Return which of "size", "angle" and "corners" a tracker declares that it measures; None if it
    declares nothing.

    Args:
        declared: One of these words, a collection of them, or None.
        name: Name of the tracker, to begin messages.

    Raises:
        ValueError: `declared` is something else.
    """
    if declared is None:
        return None
    known = get_args(Gives)
    words = [declared] if isinstance(declared, str) else declared
    if not isinstance(words, Iterable):
        words = [words]
    found: list[object] = list(cast("Iterable[object]", words))
    if unknown := [word for word in found if word not in known]:
        raise ValueError(
            f"{name} declares that it gives {shown(unknown[0])}; it may give {', '.join(known)}"
        )
    return frozenset(cast("list[Gives]", found))


def confidence_in(answer: object, name: str) -> float:
    """Return the confidence that a tracker reports, clipped to 0..1.

    Args:
        answer: The number that the tracker reported.
        name: Name of the tracker, to begin messages.

    Raises:
        ValueError: `answer` is not a number, or more than 0.001 below 0 or above 1.
    """
    found = _number(answer)
    if found is None or not -SLACK <= found <= 1 + SLACK:
        raise ValueError(f"{name}: the confidence is {shown(answer)}; it must be from 0 to 1")
    return min(max(found, 0.0), 1.0)


def convex(corners: Array) -> bool:
    """Return True if corners (4, 2) [px] form a convex quadrilateral with an area above 0."""
    points = corners.astype(np.float32)
    return cv2.contourArea(points) > 0 and cv2.isContourConvex(points)


def is_upright(corners: Array) -> bool:
    """Return True if the sides of a quadrilateral (4, 2) [px] lie along the image's axes, up to a
    thousandth of its longest side.
    """
    sides = np.abs(np.diff(corners, axis=0, append=corners[:1]))
    return bool((sides.min(axis=1) <= UPRIGHT * sides.max()).all())


def box_around(points: Array) -> Array:
    """Return the upright box (4,) of left, top, width, height around points (n, 2) [px]."""
    return np.concatenate([points.min(axis=0), np.ptp(points, axis=0)])


def outline_of(report: Report) -> Array:
    """Return the corners (4, 2) [px] of a report in which the target is seen: the reported corners
    as they are or, for a reported box, its corners, clockwise in the image.
    """
    if report.corners is not None:
        return report.corners
    assert report.box is not None  # one of the two is there
    left, top, width, height = report.box.tolist()
    centre = State(left + width / 2, top + height / 2, report.angle or 0.0)
    return Region(width, height).corners(centre)


def shown(answer: object) -> str:
    """Return a value that a tracker returned as one short line of text for messages, with "..." in
    place of what is too long.
    """
    return " ".join(reprlib.repr(answer).split())


def _of_mapping(answer: Mapping[object, object], name: str) -> Report:
    """Return the report in a mapping with some of `KEYS`.

    Raises:
        ValueError: A key is not one of `KEYS`, its value is not possible, or, though the target is
            seen, box and corners are both missing or both given.
    """
    if unknown := [key for key in answer if key not in KEYS]:
        raise ValueError(
            f"{name} answered with the key {shown(unknown[0])}; the keys are {', '.join(KEYS)}"
        )
    given = {key: value for key, value in answer.items() if value is not None}
    confidence = given.get("confidence")
    sure = None if confidence is None else confidence_in(confidence, name)
    seen = given.get("seen", True)
    if not isinstance(seen, bool | np.bool_):
        raise ValueError(f"{name}: 'seen' is {shown(seen)}; it must be true or false")
    if not seen:
        return Report(seen=False, confidence=sure)
    angle = _number(given["angle"]) if "angle" in given else None
    if "angle" in given and (angle is None or not abs(angle) <= FARTHEST):  # nan is not
        raise ValueError(
            f"{name}: 'angle' is {shown(given['angle'])}; it must be a number from "
            f"{-FARTHEST:g} to {FARTHEST:g} [rad]"
        )
    if "corners" in given and "box" in given:
        raise ValueError(f"{name} answered with both 'box' and 'corners'; one of them is expected")
    if "corners" in given:
        corners = _numbers(given["corners"], (4, 2))
        if corners is None or not convex(corners):
            raise ValueError(
                f"{name}: 'corners' is {shown(given['corners'])}; it must be four points [x, y] "
                "[px] that go around a convex region"
            )
        return Report(corners=corners.round(DIGITS), confidence=sure)
    box = _numbers(given.get("box"), (4,))
    if box is None or not _has_area(box):
        what = f"'box' is {shown(given['box'])}" if "box" in given else "'box' is missing"
        raise ValueError(
            f"{name}: {what}; it must be left, top, width, height [px] with an area, unless 'seen' "
            "is false"
        )
    return Report(box=box.round(DIGITS), angle=angle, confidence=sure)


def _number(value: object) -> float | None:
    """Return a value as a number; None if it is not a number up to `FARTHEST`."""
    found = _numbers(value, ())
    return None if found is None else float(found)


def _numbers(value: object, shape: tuple[int, ...]) -> Array | None:
    """Return a value as an array of a shape; None if it is not one of numbers up to `FARTHEST`."""
    try:
        found = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if found.shape != shape or found.dtype.kind not in NUMBERS:
        return None
    numbers = found.astype(float)
    return numbers if bool((np.abs(numbers) <= FARTHEST).all()) else None  # nan is not


def _has_area(box: Array) -> bool:
    """Return True if the sides of a box (4,) [px] are long enough for an area above 0."""
    return bool(box[2:].min() >= LEAST_SIDE)
