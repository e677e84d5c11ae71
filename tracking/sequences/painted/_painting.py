"""Random textures, noise, and pasting of a small picture into another, for painted sequences."""

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.types import Region, State

WIDTH = 320
"""Width of all painted pictures [px]."""
HEIGHT = 240
"""Height of all painted pictures [px]."""


def blotches(
    rng: np.random.Generator, width: int, height: int, grain: float, colour: Array, spread: float
) -> Image:
    """Return a random picture, RGB (height, width, 3), of soft blotches around a colour.

    Args:
        rng: Random generator.
        width: Width [px].
        height: Height [px].
        grain: Size of the blotches: standard deviation of the Gaussian that smooths noise [px].
        colour: Mean colour (3,), or mean colour of each pixel (height, width, 3) [grey levels].
        spread: Standard deviation of each channel [grey levels].
    """
    noise = cv2.GaussianBlur(rng.normal(0, 1, (height, width, 3)), (0, 0), grain)
    noise = noise / noise.std(axis=(0, 1))
    return np.clip(colour + spread * noise, 0, 255).astype(np.uint8)


def noisy(image: Image, noise: float, seed: int, index: int) -> Image:
    """Return a picture (H, W, 3) with Gaussian noise added, as uint8; the same seed and index give
    the same noise again.

    Args:
        image: The picture (H, W, 3) [grey levels], which may have fractions.
        noise: Standard deviation of the noise [grey levels].
        seed: Seed of the sequence's noise.
        index: Number of the picture in the sequence.
    """
    draws = np.random.default_rng([seed, index]).normal(0, noise, image.shape)
    return np.clip(image + draws, 0, 255).round().astype(np.uint8)


def paste(image: Image, patch: Image, region: Region, state: State) -> Image:
    """Return a copy of a picture (H, W, 3) with a patch (h, w, 3) drawn into a region.

    Args:
        image: The picture.
        patch: The patch, which is scaled to the region and turned; its edges become smooth.
        region: Size of the patch in the picture at scale 1 [px].
        state: Position [px], angle [rad] and scale of the patch in the picture.
    """
    height, width = patch.shape[:2]
    shape = (image.shape[1], image.shape[0])
    # warpAffine counts from pixel centres, so a patch spans -0.5 .. size - 0.5.
    source = np.array([[0, 0], [width, 0], [width, height]], np.float32) - 0.5
    target = (region.corners(state)[:3] - 0.5).astype(np.float32)
    warp = cv2.getAffineTransform(source.astype(np.float32), target)
    rim = ((1, 1), (1, 1))
    mask = np.pad(np.ones((height, width), np.float32), rim)
    padded = np.pad(patch, (*rim, (0, 0)), mode="edge")
    shifted = warp @ np.vstack([np.eye(3)[:2] - [[0, 0, 1], [0, 0, 1]], [0, 0, 1]])
    alpha = cv2.warpAffine(mask, shifted, shape, flags=cv2.INTER_AREA)[..., None]
    moved = cv2.warpAffine(padded, shifted, shape, borderMode=cv2.BORDER_REPLICATE)
    return (image * (1 - alpha) + moved * alpha).round().astype(np.uint8)
