"""Filling of the sheet's place in a straightened picture of a plane with copies of the plane beside
it.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image

BORDER = 12
"""The filling fades out on a border as wide as the hole's shorter side over this number."""
Area = tuple[slice, slice]
"""Rows and columns of a part of a picture."""


def filled(image: Image, hole: Area) -> Image:
    """Return a copy of a picture in which a rectangular hole is filled with copies of the parts
    beside it, whose brightness is adapted to that around the hole.

    Args:
        image: The picture, RGB, uint8 (h, w, 3).
        hole: The hole as two slices [px]: its rows and its columns.

    Raises:
        ValueError: The picture has no part of the hole's size beside the hole, and no two parts of
            half its size on opposite sides of it.
    """
    border = max(3, min(each.stop - each.start for each in hole) // BORDER)
    for plan in _plans(hole):
        targets = [_grown(part, border, image) for part, _ in plan]
        sources = [_moved(area, shift) for area, (_, shift) in zip(targets, plan, strict=True)]
        if all(_is_inside(each, image) for each in sources):
            break
    else:
        raise ValueError(
            "there is no room beside the sheet to fill its place from: show more of the plane, or "
            "give --covered crop or --covered keep"
        )
    result = image
    for (part, _), target, source in zip(plan, targets, sources, strict=True):
        around = _mask(_grown(target, border, image), image) & ~_mask(target, image)
        light = _light(image, around & ~_mask(hole, image))
        copied = result.astype(float)
        copied[target] += image[source] - _light(image, _mask(source, image))[source]
        copied[target] += light[target] - result[target]
        share = _mask(_grown(part, border // 2, image), image).astype(np.float32)
        share = cv2.blur(share, (2 * (border // 2) + 1,) * 2)[..., None]
        result = (share * copied + (1 - share) * result).clip(0, 255).round().astype(np.uint8)
    return result


def _plans(hole: Area) -> list[list[tuple[Area, tuple[int, int]]]]:
    """Return plans to fill a hole, the best first. A plan has the parts of the hole, each with the
    shift to the place that is copied into it: downwards in its own heights, and to the right in its
    own widths.
    """
    rows, columns = hole
    row = (rows.start + rows.stop) // 2
    column = (columns.start + columns.stop) // 2
    left = rows, slice(columns.start, column)
    right = rows, slice(column, columns.stop)
    upper = slice(rows.start, row), columns
    lower = slice(row, rows.stop), columns
    whole = [[(hole, shift)] for shift in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    return [*whole, [(left, (0, -1)), (right, (0, 1))], [(upper, (-1, 0)), (lower, (1, 0))]]


def _grown(area: Area, border: int, image: Image) -> Area:
    """Return an area with a border around it, as far as it is in the picture."""
    rows, columns = (
        slice(max(0, each.start - border), min(size, each.stop + border))
        for each, size in zip(area, image.shape, strict=False)
    )
    return rows, columns


def _moved(area: Area, shift: tuple[int, int]) -> Area:
    """Return an area that is moved by multiples of its own height and width."""
    rows, columns = (
        slice(each.start + by * size, each.stop + by * size)
        for each, by in zip(area, shift, strict=True)
        for size in [each.stop - each.start]
    )
    return rows, columns


def _is_inside(area: Area, image: Image) -> bool:
    """Return whether an area is completely in a picture."""
    return all(
        each.start >= 0 and each.stop <= size for each, size in zip(area, image.shape, strict=False)
    )


def _mask(area: Area, image: Image) -> NDArray[np.bool_]:
    """Return a mask (h, w) that is true in an area of a picture."""
    mask = np.zeros(image.shape[:2], bool)
    mask[area] = True
    return mask


def _light(image: Image, mask: NDArray[np.bool_]) -> Array:
    """Return the light on a picture (h, w, 3): the linear function of row and column that fits its
    values best where a mask is true.
    """
    rows, columns = np.indices(mask.shape) / max(mask.shape)
    terms = np.stack([np.ones(mask.shape), rows, columns], axis=2)
    factors = np.linalg.lstsq(terms[mask], image[mask].astype(float))[0]
    return terms @ factors
