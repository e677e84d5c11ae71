"""Encoding of pictures as the bytes of JPEG or PNG files, and of depth pictures as those of PNG
files.
"""

import cv2
import numpy as np

from sim.types import DepthPicture, Image


def encoded(image: Image, jpeg_quality: int | None = None) -> bytes:
    """Return an RGB picture (H, W, 3) as the bytes of a JPEG file with a quality of 0..100; None:
    as the bytes of a PNG file.
    """
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    if jpeg_quality is None:
        return cv2.imencode(".png", bgr)[1].tobytes()
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()


def encoded_depth(depth: DepthPicture) -> bytes:
    """Return a depth picture (H, W) [m] as the bytes of a PNG file with 16 bits in mm; nan as 0,
    and more than 65.535 m as 65.535 m.
    """
    millimetres = np.nan_to_num(1e3 * depth, nan=0.0).clip(0, np.iinfo(np.uint16).max)
    return cv2.imencode(".png", np.rint(millimetres).astype(np.uint16))[1].tobytes()
