"""Compile and load what a tracker needs, before its time counts."""

from contextlib import suppress
from typing import Protocol

import cv2
import numpy as np

from sim.types import Image
from tracking.evaluation.track import Shot, follow
from tracking.sequences.sources import Picture
from tracking.types import Region, State, Tracker

SIZE = (240, 320)
"""Height and width of the pictures on which a tracker is warmed up [px]."""
BLUR = (9, 9)
"""Window in which their noise is averaged [px], so that it has slopes to follow."""


class Config(Protocol):
    """The settings of a tracker."""

    def build(self, rng: np.random.Generator, /) -> Tracker:
        """Return the tracker."""
        ...


def warm_up(config: Config) -> list[Shot]:
    """Let a tracker of its own, that is thrown away, follow pictures of noise: its target moves by
    a pixel, and is gone.

    Compiled loops and network files are then in memory, and a tracker in another process has
    stored what it compiled. A tracker that fails here fails again on the pictures that count, with
    its sentence.

    Returns:
        What it reported, up to where it failed.
    """
    shots = list[Shot]()
    pictures = [Picture("noise", 0.0, image) for image in _images()]
    height, width = SIZE
    with suppress(Exception):
        tracker = config.build(np.random.default_rng(0))
        region = Region(width / 4, height / 4)
        shots += follow(tracker, pictures, region, State(width / 2, height / 2))
    return shots


def _images() -> list[Image]:
    """Return pictures of blurred noise: one, the same a pixel further, and another, which cannot be
    written to, as those of a simulated camera: numba compiles a loop for each of both.
    """
    noise = np.random.default_rng(0).integers(0, 256, (2, *SIZE, 3), np.uint8)
    first, other = (cv2.blur(each, BLUR) for each in noise)
    images = [first, *(np.roll(first, pixels, axis=1) for pixels in (1, 2)), other]
    for image in images[2:]:
        image.flags.writeable = False
    return images
