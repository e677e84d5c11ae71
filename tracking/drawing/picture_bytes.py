"""A picture as the bytes of a JPEG or PNG file."""

import cv2
import numpy as np

from sim.types import DepthPicture, Image


def encoded(image: Image, jpeg_quality: int | None = None) -> bytes:
    """Return an RGB picture as a JPEG file of a quality, 0 to 100, or else as a PNG file."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    if jpeg_quality is None:
        return cv2.imencode(".png", bgr)[1].tobytes()
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()


def encoded_depth(depth: DepthPicture) -> bytes:
    """Return a depth picture [m] as a PNG file of 16 bits in mm, 0 where there is no depth."""
    millimetres = np.nan_to_num(1e3 * depth, nan=0.0).clip(0, np.iinfo(np.uint16).max)
    return cv2.imencode(".png", np.rint(millimetres).astype(np.uint16))[1].tobytes()
