"""Fills the place of the sheet in a straightened picture with the plane beside it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image

BORDER = 12
"""The filling fades out on a border of this fraction of the hole's shorter side (1 / 12)."""
Area = tuple[slice, slice]
"""Rows and columns of a part of a picture."""


def filled(image: Image, hole: Area) -> Image:
    """Return a picture (h, w, 3) whose hole is filled with the part of the picture beside it, in
    the light that is around the hole.

    Raises:
        ValueError: There is no room beside it for a part of its size.
    """
    tall, wide = (each.stop - each.start for each in hole)
    border = max(3, min(tall, wide) // BORDER)
    outer = _grown(hole, border, image)
    source = _beside(outer, image)
    light = _light(image, _mask(_grown(outer, border, image), image) & ~_mask(outer, image))
    own_light = _light(image, _mask(source, image))
    result = image.astype(float)
    result[outer] = image[source] - own_light[source] + light[outer]
    share = _mask(_grown(hole, border // 2, image), image).astype(np.float32)
    share = cv2.blur(share, (2 * (border // 2) + 1,) * 2)[..., None]
    return (share * result + (1 - share) * image).clip(0, 255).round().astype(np.uint8)


def _grown(area: Area, border: int, image: Image) -> Area:
    """Return an area with a border around it, as far as it is in the picture."""
    rows, columns = (
        slice(max(0, each.start - border), min(size, each.stop + border))
        for each, size in zip(area, image.shape, strict=False)
    )
    return rows, columns


def _beside(area: Area, image: Image) -> Area:
    """Return an area of the same size beside, above or below an area.

    Raises:
        ValueError: There is no room for it in the picture.
    """
    rows, columns = area
    tall = rows.stop - rows.start
    wide = columns.stop - columns.start
    for down, right in ((0, wide), (0, -wide), (tall, 0), (-tall, 0)):
        top = rows.start + down
        left = columns.start + right
        if min(top, left) >= 0 and top + tall <= len(image) and left + wide <= image.shape[1]:
            return slice(top, top + tall), slice(left, left + wide)
    raise ValueError(
        "there is no room beside the sheet to fill its place from: show more of the plane, or give "
        "--covered crop or --covered keep"
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
