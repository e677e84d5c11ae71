"""Compiled loops: bin numbers of colours, and colours without brightness."""

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Image


@compiled()
def labels(
    image: Image, left: int, top: int, right: int, bottom: int, levels: int
) -> NDArray[np.int16]:
    """Return the bin numbers (h, w) of the pixels of a window: (r levels + g) levels + b, where r,
    g and b, 0 to levels - 1, number the equal intervals in which red, green and blue lie.

    Args:
        image: RGB (H, W, 3).
        left: First column.
        top: First row.
        right: Column after the last.
        bottom: Row after the last.
        levels: Number of bins of each channel.
    """
    found = np.empty((max(bottom - top, 0), max(right - left, 0)), np.int16)
    part = image[top:bottom, left:right]
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            # The number is written with three digits of base `levels`: red, green, blue.
            number = 0
            for k in range(3):
                number = number * levels + ((int(part[i, j, k]) * levels) >> 8)
            found[i, j] = number
    return found


@compiled()
def evened(image: Image, floor: int) -> Image:
    """Return a picture (H, W, 3) whose channels are divided by the largest one of each pixel.

    A channel c becomes 255 c / (max + floor), rounded down.

    Args:
        image: RGB (H, W, 3).
        floor: Grey levels that are added to the largest channel. They keep dark pixels dark, whose
            colour is noise.
    """
    found = np.empty_like(image)
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            whole = floor + max(int(image[i, j, 0]), int(image[i, j, 1]), int(image[i, j, 2]))
            for k in range(3):
                found[i, j, k] = 255 * int(image[i, j, k]) // whole
    return found
