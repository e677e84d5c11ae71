"""A picture file as RGB; its header is read first, so that a huge size is refused early."""

import re
import struct
from pathlib import Path

import cv2
import numpy as np

from sim.files import reading
from sim.quiet import silent_libraries
from sim.types import LARGEST_PICTURE, Image

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"})
LARGEST = 1_000_000_000
"""Largest picture file [bytes]."""
FORMATS = "JPEG, PNG, BMP, TIFF, WebP, PPM"
PNM = re.compile(rb"P[1-6](?:\s+|#[^\n]*\n)+(\d+)(?:\s+|#[^\n]*\n)+(\d+)\s")
MARKER = 0xFF
JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of the segments that contain a JPEG's size."""
TIFF_WIDTH = 256
TIFF_HEIGHT = 257
TIFF_INTEGERS = {1: "B", 3: "H", 4: "I", 16: "Q"}
"""TIFF's codes of integer types, and their formats in `struct`."""


def read_image(file: Path) -> Image:
    """A picture of any depth and number of channels as RGB (H, W, 3), read-only.

    Raises:
        ValueError: It cannot be read or decoded, or is too large.
    """
    data = reading.content(file, "picture", LARGEST)
    try:
        return decoded(data)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def decoded(data: bytes) -> Image:
    """The picture in a file's content; as for `read_image`.

    Raises:
        ValueError: It cannot be decoded, or is too large.
    """
    try:
        width, height = size_of(data)
    except (struct.error, KeyError, IndexError):
        raise ValueError("this picture is cut off or damaged") from None
    check_size(width, height)
    with silent_libraries():
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        except cv2.error:
            image = None
    if image is None:
        raise ValueError("this picture cannot be decoded")
    return rgb(image)


def check_size(width: int, height: int, what: str = "the picture") -> None:
    """Refuse a picture that is too large for memory; `what` is its name in the message.

    Raises:
        ValueError: A side is too long, or not positive.
    """
    if not 0 < min(width, height) <= max(width, height) <= LARGEST_PICTURE:
        raise ValueError(
            f"{what} has {width} x {height} px; the limit is {LARGEST_PICTURE} px a side"
        )


def size_of(data: bytes) -> tuple[int, int]:
    """Width and height [px] in a picture file's header.

    Raises:
        ValueError: The file is empty, or its format is not known.
        struct.error, KeyError, IndexError: The header is cut off or damaged.
    """
    match data[:4]:
        case b"":
            raise ValueError("this picture is an empty file")
        case b"\x89PNG":
            return struct.unpack_from(">II", data, 16)
        case b"RIFF" if data[8:16] == b"WEBPVP8X":
            return 1 + _three_bytes(data, 24), 1 + _three_bytes(data, 27)
        case b"RIFF" if data[8:14] == b"WEBPVP":
            return 1, 1  # these cannot be larger than the limit
        case b"II*\0" | b"MM\0*" | b"II+\0" | b"MM\0+":
            return _of_tiff(data)
        case _:
            pass
    if data[:2] == b"\xff\xd8":
        return _of_jpeg(data)
    if data[:2] == b"BM":
        old = struct.unpack_from("<I", data, 14)[0] == struct.calcsize("<IHHHH")
        width, height = struct.unpack_from("<HH" if old else "<ii", data, 18)
        return width, abs(height)
    netpbm = PNM.match(data[:1000])
    if netpbm:
        return int(netpbm[1]), int(netpbm[2])
    raise ValueError(f"this is not a picture; known formats are {FORMATS}")


def rgb(image: np.ndarray) -> Image:
    """A picture in OpenCV's convention (grey, BGR or BGRA) as RGB (H, W, 3), read-only."""
    code = {2: cv2.COLOR_GRAY2RGB, 4: cv2.COLOR_BGRA2RGB}
    depth = image.ndim if image.ndim == 2 or image.shape[2] != 4 else 4
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
        depth = 2
    turned = cv2.cvtColor(image, code.get(depth, cv2.COLOR_BGR2RGB)).astype(np.uint8, copy=False)
    turned.setflags(write=False)
    return turned


def _three_bytes(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 3], "little")


def _of_jpeg(data: bytes) -> tuple[int, int]:
    """The size in the first frame's header, after other segments."""
    at = 2
    while True:
        while data[at] == MARKER:
            at += 1
        marker = data[at]
        if marker in JPEG_SIZES:
            height, width = struct.unpack_from(">HH", data, at + 4)
            return width, height
        at += 1 + struct.unpack_from(">H", data, at + 1)[0]


def _of_tiff(data: bytes) -> tuple[int, int]:
    """The size in the first directory of a TIFF or BigTIFF file."""
    order = "<" if data[:1] == b"I" else ">"
    big = b"+" in data[:4]
    start = struct.unpack_from(f"{order}{'Q' if big else 'I'}", data, 8 if big else 4)[0]
    count = struct.unpack_from(f"{order}{'Q' if big else 'H'}", data, start)[0]
    first, length, value = (start + 8, 20, 12) if big else (start + 2, 12, 8)
    found: dict[int, int] = {}
    for at in range(first, first + length * min(count, 65_536), length):
        tag, kind = struct.unpack_from(f"{order}HH", data, at)
        if tag in (TIFF_WIDTH, TIFF_HEIGHT):
            found[tag] = struct.unpack_from(f"{order}{TIFF_INTEGERS[kind]}", data, at + value)[0]
    return found[TIFF_WIDTH], found[TIFF_HEIGHT]
