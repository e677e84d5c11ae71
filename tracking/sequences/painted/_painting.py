"""Random textures, noise, and pasting of a picture under a similarity, for painted sequences."""

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.types import Region, State


def blotches(
    rng: np.random.Generator, width: int, height: int, grain: float, colour: Array, spread: float
) -> Image:
    """Return a random picture (height, width, 3) of blotches.

    Args:
        rng: Random generator.
        width: Width [px].
        height: Height [px].
        grain: Size of the blotches [px].
        colour: Mean colour (3,), or a whole picture (height, width, 3).
        spread: Standard deviation of each channel [grey levels].
    """
    noise = cv2.GaussianBlur(rng.normal(0, 1, (height, width, 3)), (0, 0), grain)
    noise = noise / noise.std(axis=(0, 1))
    return np.clip(colour + spread * noise, 0, 255).astype(np.uint8)


def noisy(image: Image, noise: float, seed: int, index: int) -> Image:
    """Return a picture with Gaussian noise that depends on its number in a sequence.

    Args:
        image: The picture, also with fractions of grey levels.
        noise: Standard deviation [grey levels].
        seed: Seed of the sequence's noise.
        index: Number of the picture in the sequence.
    """
    draws = np.random.default_rng([seed, index]).normal(0, noise, image.shape)
    return np.clip(image + draws, 0, 255).round().astype(np.uint8)


def paste(image: Image, patch: Image, region: Region, state: State) -> Image:
    """Return a picture (H, W, 3) with a patch in the region at a state, with smooth edges."""
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
