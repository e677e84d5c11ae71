"""Truth files of the field's benchmarks: OTB, VOT, TLD, CSV, as corners of the target.

All coordinates become continuous pixels from the image's top left corner. OTB counts pixels from 1,
so its box 1,1,w,h begins at the corner; VOT and CSV begin at 0.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from sim.types import Array
from tracking.types import FARTHEST, Region, State

OTB_NAME = re.compile(r"groundtruth_rect.*\.txt$")
SEPARATORS = re.compile(r"[,;\s]+")
BOX, QUAD = 4, 8
CORNERS = [f"{axis}{i}" for i in range(1, 5) for axis in "xy"]
BOX_NAMES = (("left", "top", "width", "height"), ("x", "y", "width", "height"),
             ("x", "y", "w", "h"))  # fmt: skip
LONGEST = 80
"""So much of a line is quoted in a message [characters]."""
RECTANGULAR = 0.02
"""A quadrilateral is a rectangle if its corners are this near to one, over its size."""


def read(path: Path) -> Array:
    """Corners (n, 4, 2) of the target in each frame [px]; nan where it is absent.

    A file called groundtruth_rect*.txt is OTB's (1-based); a file with a header is CSV, with the
    columns x1..y4, or a box's left, top, width, height; all others are VOT's (0-based), four or
    eight numbers a line.

    Raises:
        ValueError: It cannot be read, or a line is none of these.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise ValueError(f"{path}: cannot read this truth: {reason}") from None
    lines = text.splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise ValueError(f"{path}: this truth is empty")
    if re.match(r"\s*[A-Za-z_]\w*\s*,", lines[0]) and not lines[0].lower().startswith("nan"):
        try:
            return _of_csv(lines, path)
        except csv.Error as error:
            raise ValueError(f"{path}: this is not CSV: {error}") from None
    shift = 1.0 if OTB_NAME.match(path.name) else 0.0
    rows = [_numbers(line, f"{path.name}, line {i}") for i, line in enumerate(lines, 1)]
    return np.stack([corners_of(row) - shift for row in rows])


def corners_of(numbers: Array) -> Array:
    """Corners (4, 2) of a box (left, top, width, height), or of eight numbers as they are."""
    if len(numbers) == QUAD:
        return numbers.reshape(4, 2)
    x, y, w, h = numbers
    return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])


def boxes(corners: Array) -> Array:
    """Upright boxes (n, 4) around corners (n, 4, 2): left, top, width, height."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    return np.hstack([low, high - low])


def placement(corners: Array, *, turned: bool = False) -> tuple[Region, State]:
    """Region and state of corners (4, 2).

    Args:
        corners: In order around the target, the first edge along its x axis.
        turned: Keep the rotation of corners that form a rectangle; else the upright box.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    width, height = np.hypot(*edges[0]), np.hypot(*edges[1])
    square = np.abs(edges[0] + edges[2]).max() + abs(edges[0] @ edges[1]) / max(width, 1e-9)
    x, y = corners.mean(axis=0).tolist()
    if turned and square <= RECTANGULAR * max(width, height):
        theta = float(np.arctan2(edges[0][1], edges[0][0]))
        return Region(float(width), float(height)), State(x, y, theta)
    left, top, w, h = boxes(corners[None])[0].tolist()
    return Region(w, h), State(left + w / 2, top + h / 2)


def _numbers(line: str, place: str) -> Array:
    shown = line.strip()[:LONGEST]
    try:
        numbers = np.array([float(part) for part in SEPARATORS.split(line.strip())])
    except ValueError:
        raise ValueError(f"{place}: '{shown}' is not a line of numbers") from None
    if len(numbers) not in (BOX, QUAD):
        raise ValueError(f"{place}: a line has 4 or 8 numbers, not {len(numbers)}")
    if not np.isfinite(numbers).all():
        return np.full(len(numbers), np.nan)
    if np.abs(numbers).max() > FARTHEST:
        raise ValueError(f"{place}: '{shown}' is no place in a picture; the limit is {FARTHEST:g}")
    return numbers


def _of_csv(lines: list[str], path: Path) -> Array:
    table = csv.DictReader(lines, skipinitialspace=True)
    names = [name.strip() for name in table.fieldnames or []]
    table.fieldnames = names
    if set(CORNERS) <= set(names):
        wanted = CORNERS
    else:
        wanted = next((list(box) for box in BOX_NAMES if set(box) <= set(names)), None)
    if wanted is None:
        need = "x1..y4, or left, top, width, height"
        raise ValueError(f"{path.name}: the columns are {', '.join(names)}; it needs {need}")
    rows = [
        _numbers(",".join((row[name] or "nan").strip() or "nan" for name in wanted),
                 f"{path.name}, line {i}")
        for i, row in enumerate(table, 2)
    ]  # fmt: skip
    if not rows:
        raise ValueError(f"{path}: this truth is empty")
    return np.stack([corners_of(row) for row in rows])
