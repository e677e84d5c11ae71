"""A picture as the bytes of a JPEG or PNG file."""

import cv2

from sim.types import Image


def encoded(image: Image, jpeg_quality: int | None = None) -> bytes:
    """Return an RGB picture as a JPEG file of a quality, 0 to 100, or else as a PNG file."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    if jpeg_quality is None:
        return cv2.imencode(".png", bgr)[1].tobytes()
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()
