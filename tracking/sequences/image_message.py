"""Decoding of image messages of ROS 1, ROS 2 and Foxglove to pictures with their stamps.

The package `rosbags` decodes sensor_msgs (Image, CompressedImage) by its own definitions, so that
no text of a file becomes code; `mcap-protobuf-support` decodes foxglove (RawImage,
CompressedImage).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from sim.files.bit_depth import BitDepth
from sim.files.picture_file import check_size, decoded
from sim.types import Image
from tracking.sequences.sources import SECOND

if TYPE_CHECKING:
    from mcap.records import Schema

ROS = ("sensor_msgs/Image", "sensor_msgs/CompressedImage")
FOXGLOVE = ("foxglove.RawImage", "foxglove.CompressedImage")
KINDS = {"ros1": ROS, "cdr": ROS, "protobuf": FOXGLOVE}
"""Types of image messages that can be read, by the encoding of the messages."""
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
"""Bytes of a pixel in each pixel format, and OpenCV's conversion of the format to RGB."""
DEEP = "mono16"
"""Pixel format with two bytes a pixel, of which a camera may use fewer bits."""
Decoder = Callable[[bytes], Any]
"""Returns an object with the fields of a message, given the bytes of the message."""


def plain_kind(kind: str) -> str:
    """Return a message type as ROS 1 writes it, "sensor_msgs/Image", without ROS 2's "/msg"."""
    return kind.replace("/msg/", "/")


def decoder_of(kind: str, serialization: str, schema: Schema | None = None) -> Decoder:
    """Return the function that decodes messages of a type from their bytes.

    Args:
        kind: The type, one of `KINDS[serialization]`.
        serialization: Encoding of the messages: "ros1", "cdr" or "protobuf".
        schema: Definition of the type in the file, which Protobuf needs; None: the file has none.

    Raises:
        ValueError: Protobuf's definition is missing.
    """
    if serialization == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory

        decoder = DecoderFactory().decoder_for(serialization, schema)
        if decoder is None:
            raise ValueError(
                f"the message definition of {kind} is missing in this file: write the file again "
                "with its schemas"
            )
        return decoder
    from rosbags.typesys import Stores, get_typestore

    name = kind.replace("/", "/msg/")
    is_ros1 = serialization == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    deserialize = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
    return lambda data: deserialize(data, name)


def picture_of(
    decode: Decoder, data: bytes, depth: BitDepth | None = None
) -> tuple[int | None, Image]:
    """Return the stamp [ns] of a message, None if it is not set, and its picture, RGB (H, W, 3).

    Args:
        decode: Function of `decoder_of` for the message's type.
        data: The bytes of the message.
        depth: Number of bits that 16-bit pictures of the same topic use, which the first picture
            determines; None: this picture alone determines it.

    Raises:
        ValueError: The message is cut off, has an unknown pixel format, or cannot be decoded.
    """
    try:
        message = decode(data)
    except Exception:  # the libraries raise all kinds of them for damaged bytes
        raise ValueError(
            "the message with this picture is cut off or damaged: copy or record the bag again"
        ) from None
    if hasattr(message, "header"):
        stamp = message.header.stamp.sec * SECOND + message.header.stamp.nanosec
    else:
        stamp = message.timestamp.seconds * SECOND + message.timestamp.nanos
    if hasattr(message, "encoding"):
        return stamp or None, _raw(message, depth or BitDepth())
    return stamp or None, decoded(bytes(message.data), depth)


def _raw(message: Any, depth: BitDepth) -> Image:
    """Return the picture of a message with raw pixels, RGB (H, W, 3), read-only.

    Raises:
        ValueError: The pixel format is unknown, or the data do not fit the picture's size.
    """
    known = *CODES, DEEP
    # Drivers write V4L2's "YUYV" for ROS's "yuyv".
    encoding = next((e for e in known if e.lower() == message.encoding.lower()), None)
    width = message.width
    height = message.height
    step = message.step
    data = np.frombuffer(message.data, np.uint8)
    if encoding is None:
        raise ValueError(
            f"the pixel format of this image is '{message.encoding}'; known are {', '.join(known)}"
        )
    check_size(width, height)
    size, code = CODES.get(encoding, (2, cv2.COLOR_GRAY2RGB))
    if not width * size <= step <= len(data) // height:
        raise ValueError(
            f"a picture of {width} x {height} px in {encoding} does not fit into {len(data)} bytes "
            f"with rows of {step}: correct the sizes that the camera's driver writes"
        )
    rows = data[: step * height].reshape(height, step)[:, : width * size]
    pixels = np.ascontiguousarray(rows).reshape(height, width, size)
    if encoding == DEEP:
        big_endian = bool(getattr(message, "is_bigendian", False))
        pixels = depth.reduced(pixels.view(">u2" if big_endian else "<u2")[..., 0])
    try:
        image = pixels if code is None else cv2.cvtColor(pixels, code).astype(np.uint8, copy=False)
    except cv2.error:
        raise ValueError(
            f"a picture of {width} x {height} px cannot have the pixel format {encoding}: record "
            "another, such as rgb8"
        ) from None
    image.setflags(write=False)
    return image
