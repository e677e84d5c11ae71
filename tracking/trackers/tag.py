"""Tracker of an AprilTag of the family 36h11, which is detected in each picture
(tracking.search.tag_detector).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from sim.outline import area
from sim.types import Array, Frame
from tracking.search.tag_detector import TagDetector
from tracking.trackers._plane import SQUARE, homography, state_of, through
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    Trait,
    check_region,
    unknown_covariance,
)

ALIKE = 0.1
"""A region counts as the tag's black square if its corners are nearer to the square's than this
share of the side."""


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `tag` has no settings. It follows the AprilTag 36h11 nearest to the region."""

    traits = frozenset({Trait.MARKER, Trait.CORNERS})

    def build(self, rng: np.random.Generator) -> "Tag":
        """Return a new tracker; `rng` is not used."""
        return Tag()


@final
class Tag:
    """Tracker of an AprilTag 36h11, the one nearest to the region in the first picture. It reports
    the region's corners, which stay where they were in the tag's plane; with the tag not found it
    is LOST.
    """

    _state: State = SET_BY_START

    def __init__(self) -> None:
        self._detector = TagDetector()

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Find the tag nearest to the centre of the region in the first frame, and store the
        region's corners in the tag's plane; if they are nearly those of the tag's black square
        (within a tenth of its side), those of the square.

        Raises:
            ValueError: The region is not valid, or no tag is seen.
        """
        check_region(frame, region, state)
        found = self._detector.nearest(frame.image, np.array([state.x, state.y]))
        if found is None:
            raise ValueError(
                "no AprilTag 36h11 is seen in the first picture: begin with a picture that shows "
                "the whole tag"
            )
        self._seen: Array | None
        self._number, self._seen = found
        self._region = region
        self._state = state
        self._rectangle = _or_square(_in_plane(self._seen, region, state))

    def outline(self, frame: Frame, region: Region, state: State) -> tuple[Region, State]:
        """Return the black square of the tag nearest to a region in the first frame, as a region
        [px] and its state; the given region and state if they are that square within a tenth of its
        side, or if no tag is seen.

        Raises:
            ValueError: The region is not valid.
        """
        check_region(frame, region, state)
        found = self._detector.nearest(frame.image, np.array([state.x, state.y]))
        if found is None or _near(_in_plane(found[1], region, state), SQUARE):
            return region, state
        corners = found[1]
        side = float(np.sqrt(area(corners)))
        square = Region(side, side, corners)
        return square, state_of(corners, square, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate for the next frame, LOCKED, from the tag's corners; where the tag is
        not found, the last state, moved by `ego`, as LOST.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.
        """
        expected = self._state.moved(ego)
        place = np.array([expected.x, expected.y])
        around = None
        # The detector searches around the last square first, and then the whole picture.
        if self._seen is not None:
            around = self._seen + place - (self._state.x, self._state.y)
        found = self._detector.nearest(frame.image, place, self._number, around)
        if found is None:
            self._state = expected
            self._seen = None
            return Estimate(expected, unknown_covariance(), 1.0, Status.LOST)
        self._seen = found[1]
        corners = through(homography(SQUARE, self._seen), self._rectangle)
        self._state = state_of(corners, self._region, expected)
        return Estimate(self._state, unknown_covariance(), 0.0, Status.LOCKED, corners=corners)


def _in_plane(seen: Array, region: Region, state: State) -> Array:
    """Return the corners (4, 2) of the region in the plane of a tag with corners `seen` (4, 2)
    [px], from the centre of the black square, in units of its side.

    They form a rectangle in that plane, too, with the region's centre, direction, area and ratio of
    sides.
    """
    # In the tag's plane the region keeps its shape, whatever the perspective of the first picture.
    to_plane = homography(seen, SQUARE)
    centre, nose = through(
        to_plane,
        np.array([[0, 0], [np.cos(state.theta), np.sin(state.theta)]]) + (state.x, state.y),
    )
    near = through(to_plane, region.first_corners(state))
    ahead = (nose - centre) / np.hypot(*(nose - centre))
    half = np.sqrt(
        area(near) * np.array([region.width / region.height, region.height / region.width])
    )
    return centre + (SQUARE * half) @ np.array([ahead, (-ahead[1], ahead[0])])


def _or_square(found: Array) -> Array:
    """Return the black square's corners (4, 2) in the order of a rectangle's corners (4, 2), both
    in the tag's plane, if the rectangle is the square up to noise; else the rectangle.
    """
    turned = [np.roll(SQUARE, k, axis=0) for k in range(4)]
    square = min(turned, key=lambda corners: float(np.abs(corners - found).max()))
    return square if _near(found, square) else found


def _near(found: Array, square: Array) -> bool:
    return bool(np.abs(square - found).max() < ALIKE)
