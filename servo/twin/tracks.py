"""Points of a film that are followed from picture to picture: corners spread over the whole
picture, followed forward and back by Lucas and Kanade's method.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Camera, Image
from tracking.sequences.sources import Picture

CELLS = 8, 6
"""Columns and rows of cells, each of which gives its best corners: the best of the whole picture
would be on one thing, which may move."""
EACH = 3
"""Largest number of corners of each cell."""
SPAN = 3
"""Corners are searched in every third picture."""
WINDOW = 15
"""Side of the window that is compared [px]."""
LEVELS = 3
"""Number of times that a picture is halved for the image pyramid of Lucas and Kanade's method."""
RETURNS = 0.5
"""Largest distance of a point from its start after it was followed forth and back [px]."""
WIDEST = 480
"""Width to which wider pictures are reduced [px]: the accuracy is that of many points."""
WEAK = 1e-5
"""Least response of a corner, of a picture with values from 0 to 1; noise is below it."""
DARK = 12.0
"""A picture is dark if the mean grey level (0 to 255) of its brightest pixels is below this; these
are one in 60 of a picture that is 480 px wide."""
SHOWN = 200
"""Every so many-th picture is kept, to be shown."""
FEW = 30
"""Least number of points in a pair of pictures that is used."""
STILL = 0.15
"""Largest displacement, from one picture of a pair to the other, of a point that counts as still
[px]."""
CUT = 0.25
"""If a smaller share of the points is found again in the next picture, the film counts as cut
there."""


@dataclass(frozen=True, slots=True)
class Tracks:
    """Points that were followed between p pairs of pictures of a film, at most m in each pair:
    pairs of consecutive pictures, and pairs three pictures apart.
    """

    times: Array
    """Time of each picture (n,) [s]."""
    first: NDArray[np.int64]
    """Index in `times` of the first picture of each pair (p,)."""
    second: NDArray[np.int64]
    """Index in `times` of the second picture of each pair (p,)."""
    before: Array
    """Undistorted points x = X/Z, y = Y/Z in the first picture (p, m, 2)."""
    after: Array
    """The same points in the second picture (p, m, 2)."""
    known: NDArray[np.bool_]
    """True where there is a point (p, m)."""
    focal: float
    """Given focal length in the followed pictures, which are at most 480 px wide [px]."""
    dark: float
    """Share of the pictures that are dark."""
    cuts: list[float]
    """Times at which few points are found again [s]."""
    size: tuple[int, int]
    """Width and height of the film's pictures [px]."""
    middles: list[Image]
    """Every 200th picture of the film, from the first one on, RGB, uint8 (H, W, 3)."""

    @property
    def steps(self) -> "Tracks":
        """A copy with only the pairs of consecutive pictures."""
        return self.only(self.second - self.first == 1)

    @property
    def moving(self) -> "Tracks":
        """A copy with only the points that move by more than 0.15 px: before a camera that stands
        still, those on what the hand carries.
        """
        away = self.focal * np.linalg.norm(self.after - self.before, axis=2)
        return replace(self, known=self.known & (away > STILL))

    def only(self, pairs: NDArray[np.bool_], every: int = 1) -> "Tracks":
        """Return a copy with a part of the pairs of pictures and of the points.

        Args:
            pairs: Flags (p,): True for each pair to keep.
            every: Each so many-th point of a pair is kept; 1: all.
        """
        return replace(
            self,
            first=self.first[pairs],
            second=self.second[pairs],
            before=self.before[pairs, ::every],
            after=self.after[pairs, ::every],
            known=self.known[pairs, ::every],
        )


def follow(
    pictures: Iterable[Picture],
    camera_of: Callable[[int, int], Camera],
    tick: Callable[[str], None],
) -> Tracks:
    """Return the points that are followed through a film.

    Args:
        pictures: The pictures, with their times; those that cannot be decoded are skipped.
        camera_of: Function that returns the camera of pictures of a width and height [px].
        tick: Called after each picture that can be decoded, with a note such as "120 points".
            Ctrl-C from the 30th of them on ends the film there.

    Raises:
        ValueError: There are fewer than two pictures that can be decoded.
        KeyboardInterrupt: Ctrl-C was pressed before 30 pictures were decoded.
    """
    follower = PointFollower()
    try:
        for picture in pictures:
            if picture.image is not None:
                follower.add(picture.image, picture.time)
                tick(f"{np.count_nonzero(follower.alive)} points")
    except KeyboardInterrupt:
        if len(follower.times) < FEW:
            raise
    if len(follower.times) < 2:
        raise ValueError(
            "this film has fewer than two pictures that can be decoded: record it again, or "
            "convert it to another format"
        )
    return follower.tracks(camera_of(*follower.size))


class PointFollower:
    """Follows image points from each picture of a film to the next. It keeps where the points were
    in both pictures of a pair [px, in a copy of the film that is at most 480 px wide].
    """

    def __init__(self) -> None:
        self.times: list[float] = []
        self.size = (0, 0)
        self.alive: NDArray[np.bool_] = np.empty(0, bool)
        """Whether each point was found in all pictures since the last search for corners."""
        self._pairs: list[tuple[int, int, NDArray[np.float32], NDArray[np.float32]]] = []
        self._shown: list[Image] = []
        self._cuts: list[float] = []
        self._dark = 0
        self._last: Image | None = None
        self._start = self._points = np.empty((0, 2), np.float32)
        self._factor = 1.0

    def add(self, image: Image, time: float) -> None:
        """Add the next picture of the film, and follow the points into it; in every third picture
        new points are chosen.

        Args:
            image: The picture, RGB, uint8 (H, W, 3).
            time: When it was taken [s].
        """
        number = len(self.times)
        self.times.append(time)
        if number % SHOWN == 0:
            self._shown.append(image)
        grey, self._factor = _grey(image)
        self.size = image.shape[1], image.shape[0]
        brightest = np.sort(grey[::8, ::8], axis=None)[-len(grey[::8]) :]
        self._dark += bool(brightest.mean() < DARK)
        if self._last is not None and self._last.shape == grey.shape and len(self._points):
            self._follow(self._last, grey, number)
        if number % SPAN == 0:
            self._start = self._points = corners(grey)
            self.alive = np.ones(len(self._points), bool)
        self._last = grey

    def _follow(self, last: Image, grey: Image, number: int) -> None:
        """Follow the points from the last picture into the new one, `grey`, whose number is
        `number`, and add the pairs of pictures that end with it.
        """
        moved, found = _followed(last, grey, self._points)
        before = np.count_nonzero(self.alive)
        self.alive &= found
        if before >= FEW and np.count_nonzero(self.alive) < CUT * before:
            self._cuts.append(self.times[-1])
            self.alive[:] = False
        alive = self.alive
        self._pairs.append((number - 1, number, self._points[alive], moved[alive]))
        if number % SPAN == 0:
            self._pairs.append((number - SPAN, number, self._start[alive], moved[alive]))
        self._points = moved

    def tracks(self, camera: Camera) -> Tracks:
        """Return all points that were followed, in normalised image coordinates; pairs of pictures
        with fewer than 30 points are left out.

        Args:
            camera: The camera that took the pictures.
        """
        pairs = [pair for pair in self._pairs if len(pair[2]) >= FEW]
        before, after = np.zeros((2, len(pairs), CELLS[0] * CELLS[1] * EACH, 2))
        known = np.zeros(before.shape[:2], bool)
        for k, (_, _, one, other) in enumerate(pairs):
            before[k, : len(one)] = camera.normalise((one.astype(float) + 0.5) / self._factor)
            after[k, : len(one)] = camera.normalise((other.astype(float) + 0.5) / self._factor)
            known[k, : len(one)] = True
        first, second = (np.array([pair[i] for pair in pairs], np.int64) for i in (0, 1))
        return Tracks(
            np.array(self.times),
            first,
            second,
            before,
            after,
            known,
            camera.focal * self._factor,
            self._dark / len(self.times),
            self._cuts,
            self.size,
            self._shown,
        )


def _grey(image: Image) -> tuple[Image, float]:
    """Return a picture in grey, at most 480 px wide, and its size over that of the original."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    factor = min(1.0, WIDEST / grey.shape[1])
    if factor < 1:
        grey = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8), factor


def corners(grey: Image) -> NDArray[np.float32]:
    """Return the best corners (n, 2) of a picture, (x, y) [px], where (0, 0) is the centre of the
    first pixel: at most three in each of 8 x 6 cells.

    Args:
        grey: The picture in grey, uint8 (H, W).
    """
    response = cv2.cornerMinEigenVal(grey, 5, ksize=3)
    peaks = response * (response >= cv2.dilate(response, np.ones((7, 7))))
    edge = WINDOW // 2
    peaks[:edge] = peaks[-edge:] = 0
    peaks[:, :edge] = peaks[:, -edge:] = 0
    columns, rows = CELLS
    height, width = grey.shape[0] // rows, grey.shape[1] // columns
    y, x = np.nonzero(peaks[: height * rows, : width * columns] > WEAK)
    cell = y // height * columns + x // width
    order = np.lexsort((-peaks[y, x], cell))  # cell by cell, the best corner first
    found = np.stack([x, y], axis=1)[order]
    cell = cell[order]
    rank = np.arange(len(cell)) - np.searchsorted(cell, cell)
    return found[rank < EACH].astype(np.float32)


def _followed(
    last: Image, grey: Image, points: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return where points (n, 2) of a picture are in the next one, and whether each is found."""
    size = WINDOW, WINDOW
    guess = points.copy()
    moved, one, _ = cv2.calcOpticalFlowPyrLK(
        last, grey, points, guess, winSize=size, maxLevel=LEVELS
    )
    back, other, _ = cv2.calcOpticalFlowPyrLK(
        grey, last, moved, moved.copy(), winSize=size, maxLevel=LEVELS
    )
    near = np.linalg.norm(back - points, axis=1) < RETURNS
    inside = ((moved > 0) & (moved < grey.shape[::-1])).all(axis=1)
    return np.asarray(moved, np.float32), near & inside & (one.ravel() > 0) & (other.ravel() > 0)
