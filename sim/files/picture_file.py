"""Reading of picture files as RGB, by OpenCV."""

from pathlib import Path

import cv2
import numpy as np

from sim.files import reading
from sim.files.bit_depth import DEEP, BitDepth
from sim.stderr import silent_libraries
from sim.types import LARGEST_PICTURE, Image

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"})
FORMATS = "JPEG, PNG, BMP, TIFF, WebP, PPM"
LARGEST_FILE = 1_000_000_000
"""Largest picture file [bytes]."""
LARGEST_SIDE = 2048
"""Longest side of a picture in the scene [px]; a larger picture is made smaller."""


def read_image(file: Path, depth: BitDepth | None = None) -> Image:
    """Return the picture in a file, of any bit depth and number of channels, as RGB (H, W, 3),
    uint8 and read-only.

    Args:
        file: Path of the picture file.
        depth: Number of bits that 16-bit pictures of the same source use, which the first picture
            determines and later ones share; None: this picture alone determines it.

    Raises:
        ValueError: The file cannot be read or decoded, has more than 1 GB, or has a side of more
            than 16,384 px.
    """
    data = reading.content(file, "picture", LARGEST_FILE)
    try:
        return decoded(data, depth)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def read_on_white(file: Path) -> Image:
    """Return the picture in a file as RGB (H, W, 3), uint8, made smaller if a side is longer than
    2048 px (`LARGEST_SIDE`). Where the picture is transparent, white shows through.

    Raises:
        ValueError: The file cannot be read or decoded, has more than 1 GB, or has a side of more
            than 16,384 px.
    """
    image = shrunk(read_image(file))
    with silent_libraries():
        found, kinds, exif = cv2.imreadWithMetadata(str(file), flags=cv2.IMREAD_UNCHANGED)
    whole = np.asarray(found)  # of objects, if `found` is None
    if whole.dtype.kind != "u" or whole.ndim == 2 or whole.shape[2] < 4:
        return image
    # OpenCV turns a picture as its EXIF data say, but not one with four channels.
    _, alone = cv2.imencodeWithMetadata(".png", np.ascontiguousarray(whole[..., 3]), kinds, exif)
    alpha = np.asarray(cv2.imdecode(alone, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH))
    share = shrunk(alpha) / (255 if whole.dtype == np.uint8 else 65535)
    return (255 - share[..., None] * (255.0 - image)).round().astype(np.uint8)


def shrunk(image: np.ndarray, largest: int = LARGEST_SIDE) -> np.ndarray:
    """Return a picture (H, W, ...) whose longer side is at most `largest` px: a larger picture is
    made smaller by averaging its pixels, another one is returned as it is.
    """
    side = max(image.shape[:2])
    if side <= largest:
        return image
    scale = largest / side
    size = [max(1, round(n * scale)) for n in image.shape[1::-1]]
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(image.dtype)


def decoded(data: bytes, depth: BitDepth | None = None) -> Image:
    """Return the picture in the bytes of a picture file as RGB (H, W, 3), uint8 and read-only.

    Args:
        data: Content of the file.
        depth: Number of bits that 16-bit pictures of the same source use, which the first picture
            determines and later ones share; None: this picture alone determines it.

    Raises:
        ValueError: The picture cannot be decoded, or has a side of more than 16,384 px.
    """
    depth = depth or BitDepth()
    as_eight = cv2.IMREAD_COLOR
    image = _read(data, as_eight if depth.used == DEEP else as_eight | cv2.IMREAD_ANYDEPTH)
    if image.dtype == np.uint16 and not depth.uses_all(image):
        image = depth.reduced(image)
    elif image.dtype != np.uint8:  # OpenCV's own 8 bits: those of a TIFF file are rounded
        image = _read(data, as_eight)
    return rgb(image)


def _read(data: bytes, flags: int) -> np.ndarray:
    """Return the picture in the bytes of a picture file, in the order BGR, as OpenCV decodes it
    with its `flags`.

    Raises:
        ValueError: The picture cannot be decoded, or has a side of more than 16,384 px.
    """
    with silent_libraries():
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        except cv2.error as error:  # it is empty, or has more pixels than OpenCV reads
            if "CV_IO_MAX_IMAGE" in str(error):
                raise ValueError(
                    "this picture has too many pixels: both sides should be 1 to "
                    f"{LARGEST_PICTURE} px"
                ) from None
            image = None
    if image is None:
        raise ValueError(f"this picture cannot be decoded; known formats are {FORMATS}")
    check_size(*image.shape[1::-1])
    return image


def check_size(width: int, height: int, what: str = "the picture") -> None:
    """Check that width and height of a picture are each from 1 to 16,384 px; `what` names the
    picture in the message.

    Raises:
        ValueError: A side is too long, or not positive.
    """
    if not 0 < min(width, height) <= max(width, height) <= LARGEST_PICTURE:
        raise ValueError(
            f"{what} has {width} x {height} px; both sides should be 1 to {LARGEST_PICTURE} px"
        )


def rgb(image: np.ndarray) -> Image:
    """Return a picture in OpenCV's convention, uint8, grey (H, W), BGR or BGRA (H, W, 3 or 4), as
    RGB (H, W, 3), read-only; an alpha channel is left out.
    """
    channels = 1 if image.ndim == 2 else image.shape[2]
    code = {1: cv2.COLOR_GRAY2RGB, 4: cv2.COLOR_BGRA2RGB}.get(channels, cv2.COLOR_BGR2RGB)
    turned = cv2.cvtColor(image, code).astype(np.uint8, copy=False)
    turned.setflags(write=False)
    return turned
