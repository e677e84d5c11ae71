"""Image messages of ROS 1, ROS 2 and Foxglove as pictures with their stamps.

They are read by their published layouts, never by a definition in the file, so that nothing in a
file becomes code. Sources: sensor_msgs (Image, CompressedImage) in ROS 1 serialization and in CDR
(OMG, DDS for Extensible Types), foxglove (RawImage, CompressedImage) in Protobuf.
"""

from __future__ import annotations

import struct

import cv2
import numpy as np

from sim.files.picture_file import check_size, decoded
from sim.types import Image

RAW = ("sensor_msgs/Image", "foxglove.RawImage")
COMPRESSED = (
    "sensor_msgs/CompressedImage",
    "foxglove.CompressedImage",
)
KINDS = {
    "ros1": (RAW[0], COMPRESSED[0]),
    "cdr": (RAW[0], COMPRESSED[0]),
    "protobuf": (RAW[1], COMPRESSED[1]),
}
"""Types of image messages by their serialization."""
CODES = {
    "rgb8": (3, None), "bgr8": (3, cv2.COLOR_BGR2RGB), "8UC3": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB), "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "8UC4": (4, cv2.COLOR_BGRA2RGB), "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8UC1": (1, cv2.COLOR_GRAY2RGB), "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY), "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2RGB_YUY2), "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2RGB), "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2RGB),
}  # fmt: skip
"""Bytes a pixel of each encoding, and OpenCV's conversion to RGB."""
DEEP = "mono16"
"""Two bytes a pixel, of which the high one is read, as of 16-bit PNG files and videos."""
NANO = 1e-9
LITTLE_CDR = {0: ">", 1: "<"}
"""Byte orders of plain CDR, by the second byte of a message."""
START = 4
"""Length of a CDR message's header, after which alignment counts [bytes]."""


def plain_kind(kind: str) -> str:
    """The type of a message without what differs between ROS 1 and 2: "sensor_msgs/Image"."""
    return kind.replace("/msg/", "/")


def picture_of(kind: str, serialization: str, data: bytes) -> tuple[float | None, Image]:
    """Stamp [s] and picture, RGB (H, W, 3), of a message; the stamp is None where it is not set.

    Args:
        kind: Its type, one of `KINDS[serialization]`.
        serialization: "ros1", "cdr" or "protobuf".
        data: Its bytes.

    Raises:
        ValueError: It is cut off, of an unknown encoding, or cannot be decoded.
    """
    try:
        read = _foxglove if serialization == "protobuf" else _ros
        stamp, picture = read(kind, serialization == "cdr", data)
    except (struct.error, KeyError, IndexError, UnicodeDecodeError):
        raise ValueError("this message is cut off or damaged") from None
    return stamp or None, picture


class _Fields:
    """The fields of a ROS message, one after the other."""

    def __init__(self, data: bytes, *, cdr: bool) -> None:
        self._data = data
        self._cdr = cdr
        self._at, self._order = (START, LITTLE_CDR[data[1]]) if cdr else (0, "<")

    def number(self, code: str) -> int:
        size = struct.calcsize(code)
        if self._cdr:
            self._at += -(self._at - START) % size
        (found,) = struct.unpack_from(self._order + code, self._data, self._at)
        self._at += size
        return found

    def block(self) -> bytes:
        length = self.number("I")
        found = self._data[self._at : self._at + length]
        if len(found) < length:
            raise IndexError(length)
        self._at += length
        return found

    def text(self) -> str:
        return self.block().rstrip(b"\0").decode()


def _ros(kind: str, cdr: bool, data: bytes) -> tuple[float, Image]:
    fields = _Fields(data, cdr=cdr)
    if not cdr:
        fields.number("I")  # the header's count of messages
    stamp = fields.number("i") + NANO * fields.number("I")
    fields.text()  # the camera's frame
    if kind in COMPRESSED:
        fields.text()  # the format, which the data states too
        return stamp, decoded(fields.block())
    height = fields.number("I")
    width = fields.number("I")
    encoding = fields.text()
    big = fields.number("B") != 0
    step = fields.number("I")
    return stamp, _rgb(width, height, encoding, step, fields.block(), big=big)


def _foxglove(kind: str, _: bool, data: bytes) -> tuple[float, Image]:
    found = _protobuf(data)
    time = _protobuf(_block(found.get(1, b"")))
    stamp = _int(time.get(1, 0)) + NANO * _int(time.get(2, 0))
    if kind in COMPRESSED:
        return stamp, decoded(_block(found[2]))
    width, height, step = (_int(found[at]) for at in (2, 3, 5))
    return stamp, _rgb(width, height, _block(found[4]).decode(), step, _block(found[6]))


def _block(value: bytes | int) -> bytes:
    """A field of bytes, not a number: bytes(number) would be as many zeros."""
    if isinstance(value, int):
        raise KeyError(value)
    return value


def _int(value: bytes | int) -> int:
    return value if isinstance(value, int) else int.from_bytes(value, "little")


def _protobuf(data: bytes) -> dict[int, bytes | int]:
    """The fields of a Protobuf message by their numbers; the last value of each."""
    found: dict[int, bytes | int] = {}
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        if tag & 7 == 0:
            found[tag >> 3], at = _varint(data, at)
            continue
        size, at = _varint(data, at) if tag & 7 == 2 else ({1: 8, 5: 4}[tag & 7], at)
        if len(data) - at < size:
            raise IndexError(size)
        found[tag >> 3] = data[at : at + size]
        at += size
    return found


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        shift = shift + 7
        at = at + 1
        if not data[at - 1] & 0x80:
            return value, at


def _rgb(
    width: int, height: int, encoding: str, step: int, data: bytes, *, big: bool = False
) -> Image:
    """A raw picture with rows of `step` bytes; `big`: of larger numbers the high byte is first."""
    if encoding not in (*CODES, DEEP):
        raise ValueError(f"its encoding is '{encoding}'; known are {', '.join((*CODES, DEEP))}")
    check_size(width, height)
    size, code = CODES.get(encoding, (2, cv2.COLOR_GRAY2RGB))
    if not width * size <= step <= len(data) // height:
        raise ValueError(
            f"a picture of {width} x {height} px in {encoding} does not fit into {len(data)} bytes "
            f"with rows of {step}"
        )
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)[:, : width * size]
    pixels = np.ascontiguousarray(rows).reshape(height, width, size)
    if encoding == DEEP:
        pixels = np.ascontiguousarray(pixels[..., 0 if big else 1])
    try:
        image = pixels if code is None else cv2.cvtColor(pixels, code).astype(np.uint8, copy=False)
    except cv2.error:
        raise ValueError(f"a picture of {width} x {height} px cannot be in {encoding}") from None
    image.setflags(write=False)
    return image
