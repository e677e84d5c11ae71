"""A photograph of a plane on which a printed sheet of AprilTags lies, and its perspective
correction.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, hypot

import cv2
import numpy as np
from numpy.typing import NDArray

from servo.photo.sheet import LARGEST
from sim.files.picture_file import LARGEST_SIDE
from sim.types import Array, Camera, Image

LEAST_DETAIL = 0.4
"""Smallest resolution of a used part of the plane, relative to that at the sheet."""
GRID = 200
"""Points along each side of the grid on which the seen part of the plane is found."""
MARGIN = 0.004
"""Border around the sheet that counts as covered: paper bends and has a shadow [m]."""
FINEST = 4
"""Largest number of samples along the side of a pixel."""
BAND = 64
"""Rows of a picture that are straightened at a time, for the sake of memory."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle on the plane, along the axes of the printed sheet: its borders [m] in the sheet's
    frame, whose origin is the sheet's middle, with x to the right and y upwards.
    """

    left: float
    bottom: float
    right: float
    top: float

    @property
    def size(self) -> Array:
        """Width (along x) and height (along y) of the rectangle (2,) [m]."""
        return np.array([self.right - self.left, self.top - self.bottom])

    def grid(self, columns: int, rows: int) -> Array:
        """Divide this rectangle into a grid of equal cells, and return their centres (rows,
        columns, 2) [m] in the sheet's frame; the first row is the uppermost, the first column the
        leftmost.
        """
        x = self.left + (np.arange(columns) + 0.5) * (self.right - self.left) / columns
        y = self.top - (np.arange(rows) + 0.5) * (self.top - self.bottom) / rows
        return np.stack(np.meshgrid(x, y), axis=2)


@dataclass(frozen=True)
class Photograph:
    """A photograph of a plane on which the printed sheet of AprilTags was found: the image, its
    camera, and the homography `H` from the plane to normalised image coordinates.

    Points on the plane are given in the sheet's frame [m]: its origin is the sheet's middle, x
    points to the right and y upwards.
    """

    image: Image
    """The photograph, RGB (H, W, 3)."""
    camera: Camera
    """Its camera."""
    H: Array
    """Homography (3, 3) from the plane, in the sheet's frame [m], to normalised coordinates."""
    tags: int
    """Number of the sheet's tags that are seen."""
    error: float
    """Rms distance of the tags' corners from their places on the sheet [m]."""
    scale: float
    """Printed size of the sheet, relative to its design size."""

    @property
    def paper(self) -> Rectangle:
        """Rectangle around the printed sheet in its own frame [m]: as wide as Letter and as high as
        A4 paper, times the printed scale, with a border of 4 mm.
        """
        half = self.scale * np.array(LARGEST) / 2 + MARGIN
        return Rectangle(*-half, *half)

    @cached_property
    def resolution(self) -> float:
        """Resolution of the photograph at the sheet's middle [px per metre on the plane]: the
        geometric mean of the largest and the smallest over all directions.
        """
        return float(np.sqrt(np.prod(self.resolutions(np.zeros((1, 2))))))

    def pixels(self, points: Array) -> Array:
        """Return the pixels (..., 2) [px] at which the photograph shows points (..., 2) of the
        plane, given in the sheet's frame [m]; nan for points behind the camera.
        """
        seen = points @ self.H[:, :2].T + self.H[:, 2]
        depth = np.where(seen[..., 2:] > 0, seen[..., 2:], np.nan)
        return self.camera.to_pixels(seen[..., :2] / depth)

    def resolutions(self, points: Array) -> Array:
        """Return the largest and the smallest resolution (..., 2) [px per metre on the plane], in
        this order, over all directions at points (..., 2) of the plane, given in the sheet's frame
        [m]; 0 for points behind the camera.
        """
        step = 1e-4
        along = [self.pixels(points + d) - self.pixels(points - d) for d in step * np.eye(2)]
        slopes = np.nan_to_num(np.stack(along, axis=-1) / (2 * step))
        return np.linalg.svd(slopes, compute_uv=False).astype(float)

    def usable(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask (...), true for the points (..., 2) of the plane, given in the sheet's
        frame [m], that the photograph shows and whose smallest resolution over all directions is
        more than 0.4 times `resolution`.
        """
        u, v = np.moveaxis(self.pixels(points), -1, 0)
        inside = (u > 0) & (u < self.camera.width) & (v > 0) & (v < self.camera.height)
        return inside & (self.resolutions(points)[..., 1] > LEAST_DETAIL * self.resolution)

    def _bounds(self, around: Rectangle) -> Rectangle:
        """Return the rectangle around what is usable in a rectangle of the plane."""
        points = around.grid(GRID, GRID)
        usable = points[self.usable(points)]
        cell = around.size / GRID
        return Rectangle(*(usable.min(axis=0) - cell), *(usable.max(axis=0) + cell))

    def part(self, *, with_sheet: bool) -> Rectangle:
        """Return the largest rectangle of the plane along the sheet's axes, in the sheet's frame
        [m], in which all points are `usable`, found on a grid of 200 x 200 points. With
        `with_sheet` false it does not overlap the rectangle `paper` around the sheet; its sides are
        0 if nothing else is usable.
        """
        far = hypot(self.camera.width, self.camera.height) / (LEAST_DETAIL * self.resolution)
        around = Rectangle(-far, -far, far, far)
        for _ in range(2):
            around = self._bounds(around)
        points = around.grid(GRID, GRID)
        usable = self.usable(points)
        if not with_sheet:
            paper = self.paper
            x, y = np.moveaxis(points, -1, 0)
            covered = (x > paper.left) & (x < paper.right) & (y > paper.bottom) & (y < paper.top)
            usable &= ~covered
        rows, columns = largest_rectangle(usable)
        (left, top), (right, bottom) = points[rows[0], columns[0]], points[rows[1], columns[1]]
        return Rectangle(left, bottom, right, top)

    def straightened(self, part: Rectangle) -> tuple[Image, float]:
        """Return the picture of a rectangle of the plane as seen from straight above, RGB, uint8
        (h, w, 3), the sheet's +y up; and its resolution [px/m].

        The resolution is that at the sheet's middle, or less, so that no side of the picture is
        longer than 2048 px.
        """
        scale = min(self.resolution, LARGEST_SIDE / float(part.size.max()))
        width, height = np.maximum(np.rint(part.size * scale).astype(int), 1).tolist()
        finest = float(self.resolutions(part.grid(2, 2)).max())
        fine = min(FINEST, max(1, ceil(finest / scale)))
        picture = np.empty((height, width, 3), np.uint8)
        for first in range(0, height, BAND):
            count = min(BAND, height - first)
            top, bottom = (
                part.top - row * (part.top - part.bottom) / height for row in (first, first + count)
            )
            band = Rectangle(part.left, bottom, part.right, top)
            at = self.pixels(band.grid(fine * width, fine * count)) - 0.5
            u, v = np.moveaxis(at.astype(np.float32), -1, 0)
            seen = cv2.remap(self.image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            picture[first : first + count] = cv2.resize(
                seen, (width, count), interpolation=cv2.INTER_AREA
            )
        return picture, width / float(part.size[0])


def largest_rectangle(
    usable: NDArray[np.bool_],
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the largest rectangle of a mask (n, m) in which all entries are true, as (first row,
    last row) and (first column, last column), both inclusive; all are 0 if no entry is true.
    """
    best = 0
    found = ((0, 0), (0, 0))
    for top in range(len(usable)):
        whole = usable[top]
        for bottom in range(top, len(usable)):
            whole = whole & usable[bottom]
            steps = np.diff(np.concatenate([[False], whole, [False]]).astype(np.int8))
            begins = np.flatnonzero(steps > 0)
            if not len(begins):
                break
            widths = np.flatnonzero(steps < 0) - begins
            k = int(widths.argmax())
            area = int(widths[k]) * (bottom - top + 1)
            if area > best:
                best = area
                found = ((top, bottom), (int(begins[k]), int(begins[k] + widths[k] - 1)))
    return found
