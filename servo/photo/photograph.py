"""A photograph of a plane with the sheet of tags on it, and its straightened picture."""

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
    """A part of the plane in the sheet's frame [m]."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def size(self) -> Array:
        """Width and height (2,) [m]."""
        return np.array([self.right - self.left, self.top - self.bottom])

    def grid(self, columns: int, rows: int) -> Array:
        """Return the middles of a grid of cells (rows, columns, 2) [m], from the upper left."""
        x = self.left + (np.arange(columns) + 0.5) * (self.right - self.left) / columns
        y = self.top - (np.arange(rows) + 0.5) * (self.top - self.bottom) / rows
        return np.stack(np.meshgrid(x, y), axis=2)


@dataclass(frozen=True)
class Photograph:
    """A photograph of a plane with the sheet on it."""

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
    """Printed size of the sheet, relative to its own."""

    @property
    def paper(self) -> Rectangle:
        """The part of the plane that the sheet covers, with a border."""
        half = self.scale * np.array(LARGEST) / 2 + MARGIN
        return Rectangle(*-half, *half)

    @cached_property
    def resolution(self) -> float:
        """Resolution at the sheet's middle [px/m]."""
        return float(np.sqrt(np.prod(self.resolutions(np.zeros((1, 2))))))

    def pixels(self, points: Array) -> Array:
        """Return the pixels (..., 2) [px] of points (..., 2) on the plane, in the sheet's frame
        [m]; nan behind the camera.
        """
        seen = points @ self.H[:, :2].T + self.H[:, 2]
        depth = np.where(seen[..., 2:] > 0, seen[..., 2:], np.nan)
        return self.camera.to_pixels(seen[..., :2] / depth)

    def resolutions(self, points: Array) -> Array:
        """Return the largest and the smallest resolution (..., 2) [px/m] over all directions at
        points (..., 2) on the plane, in the sheet's frame [m]; 0 behind the camera.
        """
        step = 1e-4
        along = [self.pixels(points + d) - self.pixels(points - d) for d in step * np.eye(2)]
        slopes = np.nan_to_num(np.stack(along, axis=-1) / (2 * step))
        return np.linalg.svd(slopes, compute_uv=False).astype(float)

    def usable(self, points: Array) -> NDArray[np.bool_]:
        """Return which points (..., 2) of the plane, in the sheet's frame [m], are in the
        photograph, with a resolution of more than 0.4 of that at the sheet's middle.
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
        """Return the largest rectangle of the plane, along the sheet's axes, all of which is
        `usable`; unless `with_sheet`, it leaves out `paper`.
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
        """Return a part of the plane as seen from straight above, RGB (h, w, 3), and its resolution
        [px/m]: that at the sheet, unless the picture would have more than 2048 px a side.
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
    """Return the first and the last row, and the first and the last column, of the largest
    rectangle of a mask (n, m) in which all is true.
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
