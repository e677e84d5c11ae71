"""Detection of AprilTags of the family 36h11 in a picture; corners are where lines fitted to the
four edges meet.

Olson 2011, "AprilTag: A robust and flexible visual fiducial system" (ICRA); Wang, Olson 2016,
"AprilTag 2: Efficient and robust fiducial detection" (IROS), as OpenCV's aruco module has it; where
it finds no tag, the quadrangles of Garrido-Jurado, Munoz-Salinas, Madrid-Cuevas, Marin-Jimenez
2014, "Automatic generation and detection of highly reliable fiducial markers under occlusion"
(Pattern Recognition 47(6)).
"""

from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking.types import SMALLEST_SIDE, check_picture

Grey = NDArray[np.uint8]
Numbered = tuple[int, Array]
"""Number and corners (4, 2) [px] of a tag."""
# Chosen by hand on rendered tags of 30 to 200 px (tracking/RESULTS.md has the errors).
CELLS = 8
"""Cells along a side of the black square."""
AROUND = 0.5
"""A tag is searched first in its last bounding box, with a margin of this share of its sides."""
ENOUGH = 50.0
"""A tag that had sides of more than so many pixels is searched in a reduced picture; its edges are
fitted in the full one."""
CONTRAST = 0.25
"""Least median strength along an edge, over the range of brightness around all edges: where the
border of the picture cuts the tag off there is no edge."""
ALONG = np.linspace(0.06, 0.94, 40)
ACROSS = np.linspace(-1.0, 1.0, 15)
"""Points at which an edge is sampled: along it over its length, across it over `REACH` cells."""
REACH = 0.8
"""Distance from an edge up to which it is sampled, in cells: beyond are other edges."""
FARTHEST = 3.0
"""Largest distance from an edge at which it is sampled [px]."""
METHODS = (cv2.aruco.CORNER_REFINE_APRILTAG, cv2.aruco.CORNER_REFINE_NONE)
"""Quadrangles are found by AprilTag's own method, and where it finds no tag by OpenCV's: each
misses upright tags that the other one finds."""


@final
class TagDetector:
    """Finds the corners [px] of AprilTags 36h11 in a picture: a detector of OpenCV finds a tag, or,
    where it finds none, a second one; the corners are where lines fitted to the tag's four edges
    meet.
    """

    def __init__(self) -> None:
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self._detectors: list[cv2.aruco.ArucoDetector] = []
        for method in METHODS:
            options = cv2.aruco.DetectorParameters()
            options.cornerRefinementMethod = method
            self._detectors.append(cv2.aruco.ArucoDetector(family, options))

    def find(self, image: Image, number: int, seen: Array | None) -> Array | None:
        """Return the corners (4, 2) [px] of the tag with a number, clockwise from the top left of
        the tag's own pattern; None where the tag is not seen.

        Args:
            image: The picture, RGB (H, W, 3).
            number: Number of the tag.
            seen: Corners (4, 2) [px] of the tag in the picture before, around which it is searched
                first; None: the whole picture is searched at once.
        """
        place = np.zeros(2) if seen is None else seen.mean(axis=0)
        found = self.nearest(image, place, number, seen)
        return None if found is None else found[1]

    def nearest(
        self, image: Image, place: Array, number: int | None = None, around: Array | None = None
    ) -> Numbered | None:
        """Return the number and corners (4, 2) [px], clockwise from the top left of the tag's own
        pattern, of the tag nearest to a place; None where no tag is seen, or not all four edges of
        the nearest one.

        Args:
            image: The picture, RGB (H, W, 3).
            place: The place (2,) where the tag is expected [px].
            number: Number of the tag; None: any.
            around: Quadrangle (4, 2) [px] around which a tag with a given number is searched first;
                without a number, or for None, the whole picture is searched at once.
        """
        check_picture(image)
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.uint8)
        if number is None:
            seen = [tag for detector in self._detectors for tag in _tags_in(detector, grey)]
            if not seen:
                return None
            number = _nearest_of(seen, place)[0]
        parts = (None,) if around is None else (around, None)
        for detector in self._detectors:
            for part in parts:
                seen = [tag for tag in _tags_in(detector, grey, part) if tag[0] == number]
                fitted = _fitted(grey, _nearest_of(seen, place)[1]) if seen else None
                if fitted is not None:
                    return number, fitted
        return None


def _nearest_of(seen: list[Numbered], place: Array) -> Numbered:
    """Return the tag whose centre is nearest to a place (2,) [px]."""
    return min(seen, key=lambda tag: np.hypot(*(tag[1].mean(axis=0) - place)))


def _tags_in(
    detector: cv2.aruco.ArucoDetector, grey: Grey, around: Array | None = None
) -> list[Numbered]:
    """Return the tags that a detector finds around a quadrangle (4, 2) [px]; in the whole picture
    where that is None.
    """
    low = np.zeros(2, int)
    high = np.array(grey.shape[::-1])
    if around is not None:
        margin = AROUND * np.ptp(around, axis=0)
        low = np.clip(around.min(axis=0) - margin, 0, high).astype(int)
        high = np.clip(around.max(axis=0) + margin, 0, high).astype(int)
    shrink = 1 if around is None else max(1, int(np.ptp(around, axis=0).min() / ENOUGH))
    width, height = ((high - low) // shrink).tolist()
    if min(width, height) < SMALLEST_SIDE:
        return []
    part = grey[low[1] :, low[0] :][: height * shrink, : width * shrink]
    part = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
    seen, numbers, _ = detector.detectMarkers(part)
    return [
        (int(n), corners[0].astype(np.float64) * shrink + low)
        for corners, n in zip(seen, np.ravel(numbers), strict=False)  # None if there is none
    ]


def _fitted(grey: Grey, corners: Array) -> Array | None:
    """Return better corners (4, 2) [px] of a dark square with the approximate ones `corners` (4, 2)
    [px]: where lines fitted to its four edges meet.

    The square is dark inside and bright outside. Along each edge the brightness is sampled across
    it; the edge is where it rises, weighed by how much. A line is fitted to these places by
    weighted least squares, twice.

    Returns:
        The corners, or None where an edge is missing, or one is more than 6 px from `corners`.
    """
    better = corners
    for _ in range(2):
        along = np.roll(better, -1, axis=0) - better
        length = np.maximum(np.hypot(*along.T), 1.0)
        out = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
        cell = np.minimum(np.roll(length, 1), np.roll(length, -1)) / CELLS
        across = np.minimum(REACH * cell, FARTHEST)[:, None] * ACROSS
        points = (
            better[:, None, None]
            + ALONG[:, None, None] * along[:, None, None]
            + across[:, None, :, None] * out[:, None, None]
        ).astype(np.float32) - np.float32(0.5)
        u, v = points.reshape(-1, len(ACROSS), 2).transpose(2, 0, 1)
        light = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        rise = np.maximum(np.diff(light.reshape(4, len(ALONG), -1).astype(float), axis=2), 0.0)
        weight = rise.sum(axis=2)
        if (np.median(weight, axis=1) <= CONTRAST * np.ptp(light)).any():
            return None
        middle = (across[:, None, 1:] + across[:, None, :-1]) / 2
        offset = (rise * middle).sum(axis=2) / np.maximum(weight, 1.0)
        better = _crossings(better, along, out, offset, weight)
    return better if np.abs(better - corners).max() <= 2 * FARTHEST else None


def _crossings(corners: Array, along: Array, out: Array, offset: Array, weight: Array) -> Array:
    """Return the corners (4, 2) [px] where lines meet that are fitted to four edges.

    Args:
        corners: First corner of each edge (4, 2) [px].
        along: Vector from there to the next corner (4, 2) [px].
        out: Unit normal of each edge, outwards (4, 2).
        offset: Distance of the edge outwards from that vector (4, n) [px], at `ALONG`.
        weight: Weight of each distance (4, n).
    """
    total = weight.sum(axis=1)
    t = weight @ ALONG / total
    s = (weight * offset).sum(axis=1) / total
    spread = ALONG - t[:, None]
    slope = (weight * spread * offset).sum(axis=1) / (weight * spread**2).sum(axis=1)
    on = corners + t[:, None] * along + s[:, None] * out
    direction = along + slope[:, None] * out
    before = np.roll(direction, 1, axis=0)
    ahead = on - np.roll(on, 1, axis=0)
    cross = before[:, 0] * direction[:, 1] - before[:, 1] * direction[:, 0]
    part = (ahead[:, 0] * direction[:, 1] - ahead[:, 1] * direction[:, 0]) / cross
    return np.roll(on, 1, axis=0) + part[:, None] * before
