"""Contact sheets: one image with pictures of a sequence in rows, in which true and estimated
outlines are drawn.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.drawing.colours import ESTIMATE, TRUTH
from tracking.sequences.sources import Picture, Source

TILE = 240
"""Width of a picture on the sheet [px]."""
GAP = 4
"""Space between pictures [px]."""
COLUMNS = 4
"""Number of pictures in a row."""
SUBPIXEL_BITS = 4
"""Fractional bits of OpenCV's coordinates: outlines are drawn to sixteenths of a pixel."""
FARTHEST = 2**30
"""Largest coordinate to which OpenCV draws a line [1/16 px]."""


def outline(
    image: Image,
    corners: Array,
    colour: tuple[int, int, int],
    factor: float = 1,
    width: int = 1,
    *,
    closed: bool = True,
) -> None:
    """Draw a polygon or an open line with a black border into an image; nothing if a point is nan.

    Args:
        image: RGB (H, W, 3), which is changed.
        corners: Points (n, 2) in pixels of the picture before it was resized.
        colour: Colour of the line (RGB).
        factor: Factor by which the picture was resized to the image.
        width: Width of the line without its border [px].
        closed: Join the last point to the first.
    """
    if not np.isfinite(corners).all():
        return
    unit = 1 << SUBPIXEL_BITS
    at = np.round((corners * factor - 0.5) * unit).clip(-FARTHEST, FARTHEST).astype(np.int32)
    cv2.polylines(image, [at], closed, (0, 0, 0), width + 2, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.polylines(image, [at], closed, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def sheet(source: Source, truth: Array, found: Array | None, count: int = 12) -> Image:
    """Return a contact sheet, RGB (H, W, 3), of up to `count` pictures, evenly spaced in a
    sequence.

    Args:
        source: The n pictures of the sequence.
        truth: True corners (n, 4, 2) [px], drawn white.
        found: Estimated corners (up to n, 4, 2) [px], drawn green; None: unknown.
        count: Largest number of pictures on the sheet.
    """
    wanted = set(np.linspace(0, len(truth) - 1, min(count, len(truth))).astype(int).tolist())
    return page(
        [
            tile(picture, truth[i], None if found is None or i >= len(found) else found[i])
            for i, picture in enumerate(source)
            if i in wanted
        ]
    )


def page(tiles: Sequence[Image]) -> Image:
    """Return one image, RGB (H, W, 3), with small pictures (h, 240, 3), at least one, in rows of
    four on a dark ground.
    """
    height = max(t.shape[0] for t in tiles)
    columns = min(COLUMNS, len(tiles))
    rows = -(-len(tiles) // columns)
    whole = np.full((rows * (height + GAP) + GAP, columns * (TILE + GAP) + GAP, 3), 30, np.uint8)
    for i, one in enumerate(tiles):
        y = GAP + i // columns * (height + GAP)
        x = GAP + i % columns * (TILE + GAP)
        whole[y : y + one.shape[0], x : x + TILE] = one
    return whole


def tile(picture: Picture, truth: Array, found: Array | None) -> Image:
    """Return one picture of a contact sheet, RGB (h, 240, 3): resized to a width of 240 px, with
    its name and two outlines.

    Args:
        picture: The picture; black if it could not be read.
        truth: True corners (4, 2) in pixels of the picture, drawn white; nan: not drawn.
        found: Estimated corners (4, 2) in pixels of the picture, drawn green; None: not drawn.
    """
    image = np.zeros((TILE * 3 // 4, TILE, 3), np.uint8) if picture.image is None else picture.image
    factor = TILE / image.shape[1]
    size = (TILE, max(1, round(image.shape[0] * factor)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    outline(small, truth, TRUTH, factor)
    if found is not None:
        outline(small, found, ESTIMATE, factor)
    cv2.putText(small, picture.name, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 3)
    cv2.putText(small, picture.name, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, TRUTH, 1)
    return small
