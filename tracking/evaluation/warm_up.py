"""Warm-up of a tracker, so that compilation and loading do not count as its computing time."""

from contextlib import suppress

import cv2
import numpy as np

from sim.kinds import PartConfig
from sim.types import Image
from tracking.evaluation.track import Shot, follow
from tracking.sequences.sources import Picture
from tracking.types import Region, State, Tracker

SIZE = (240, 320)
"""Height and width of the pictures on which a tracker is warmed up [px]."""
BLUR = (9, 9)
"""Window in which the noise is averaged [px], so that trackers find gradients in it."""


def warm_up(config: PartConfig[Tracker]) -> list[Shot]:
    """Run a new tracker on pictures of noise, in which its target moves by a pixel, and on black
    ones, in which it is lost, so that its compiled loops and network files are loaded.

    Of a tracker in another process the compiled loops are then on the disk. An error of the tracker
    is ignored here: the tracker raises it again on the user's pictures.

    Args:
        config: Settings of the tracker.

    Returns:
        The tracker's results for these pictures up to its first error.
    """
    shots = list[Shot]()
    # A second apart: the target is LOST, not only UNSURE, in the last one.
    pictures = [Picture("noise", float(i), image) for i, image in enumerate(_images())]
    height, width = SIZE
    with suppress(Exception):
        tracker = config.build(np.random.default_rng(0))
        region = Region(width / 4, height / 4)
        shots += follow(tracker, pictures, region, State(width / 2, height / 2))
    return shots


def _images() -> list[Image]:
    """Return four pictures of blurred noise (one, the same one moved by 1 and by 2 pixels, and one
    of other noise), and three black ones.
    """
    noise = np.random.default_rng(0).integers(0, 256, (2, *SIZE, 3), np.uint8)
    first, other = (cv2.blur(each, BLUR) for each in noise)
    moved = [np.roll(first, pixels, axis=1) for pixels in (1, 2)]
    return [first, *moved, other, *[np.zeros_like(first)] * 3]
