"""Messages of ROS 2 as bytes (CDR), with their definitions, by `rosbags`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

SECOND = 1_000_000_000
"""One second [ns]."""
CORNER = "foxglove_msgs/Point2"
COLOUR = "foxglove_msgs/Color"
STAMP = "builtin_interfaces/Time timestamp\n"
ANNOTATIONS = {
    "Point2": "float64 x\nfloat64 y",
    "Color": "float64 r\nfloat64 g\nfloat64 b\nfloat64 a",
    "CircleAnnotation": f"{STAMP}{CORNER} position\nfloat64 diameter\nfloat64 thickness\n"
    f"{COLOUR} fill_color\n{COLOUR} outline_color",
    "PointsAnnotation": f"{STAMP}uint8 type\n{CORNER}[] points\n{COLOUR} outline_color\n"
    f"{COLOUR}[] outline_colors\n{COLOUR} fill_color\nfloat64 thickness",
    "TextAnnotation": f"{STAMP}{CORNER} position\nstring text\nfloat64 font_size\n"
    f"{COLOUR} text_color\n{COLOUR} background_color",
    "ImageAnnotations": "foxglove_msgs/CircleAnnotation[] circles\n"
    "foxglove_msgs/PointsAnnotation[] points\nfoxglove_msgs/TextAnnotation[] texts",
}
"""Definitions of the package foxglove_msgs, which is not one of ROS's own."""


class Kind:
    """A type of ROS 2 messages, such as "sensor_msgs/Image", with its definition and its encoding.
    A new type is given by its `fields`: ROS types by name of the field.
    """

    def __init__(self, name: str, fields: Mapping[str, str] | None = None) -> None:
        """Look up a message type of ROS 2 by its name; a type of our own is defined by its fields
        and their ROS types.
        """
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.name = name.replace("/", "/msg/")
        self._store = _known()
        if fields is not None:
            text = "\n".join(f"{of} {field}" for field, of in fields.items())
            self._store = get_typestore(Stores.EMPTY)
            self._store.register(get_types_from_msg(text, self.name))

    @property
    def definition(self) -> bytes:
        """Text of the definition of this type and of all types in its fields, in the format
        `ros2msg`, as bytes.
        """
        return self._store.generate_msgdef(self.name, ros_version=2)[0].encode()

    def encoded(self, **fields: Any) -> bytes:
        """Return a message of this type, with the given value for each of its fields, as bytes in
        CDR.
        """
        message = self._store.types[self.name](**fields)
        return bytes(self._store.serialize_cdr(message, self.name))


@cache
def _known() -> Any:
    """Return the message types of ROS 2 and of foxglove_msgs; those that are used here are the same
    in all distributions of ROS 2.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in ANNOTATIONS.items():
        store.register(get_types_from_msg(text, f"foxglove_msgs/msg/{name}"))
    return store


def part(kind: str, **fields: object) -> object:
    """Return a message object of a type, such as "geometry_msgs/Point32", with the given value for
    each of its fields, for use as a field of another message.
    """
    return _known().types[kind.replace("/", "/msg/")](**fields)


def stamp(at: int) -> object:
    """Return a time [ns] as a ROS 2 message object of the type builtin_interfaces/Time."""
    return part("builtin_interfaces/Time", sec=at // SECOND, nanosec=at % SECOND)


def header(at: int, frame: str) -> object:
    """Return a ROS 2 message object of the type std_msgs/Header, with a time [ns] and the name of a
    coordinate frame, such as "camera".
    """
    return part("std_msgs/Header", stamp=stamp(at), frame_id=frame)
