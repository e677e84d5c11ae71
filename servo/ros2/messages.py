"""DDS types of ROS 2 messages, made from the message definitions in the package `rosbags`, and
conversions between messages and arrays.
"""

from functools import cache
from typing import Any

import numpy as np
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl._machinery import BytesMachine
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32
from rosbags.typesys import Stores, get_typestore

from servo.mistake import Mistake, check_known
from sim.types import Array, DepthPicture

Message = Any
"""A message of ROS 2, its type, or a part of either: DDS makes the types at run time."""
FIELDS: Message = get_typestore(Stores.ROS2_HUMBLE).fielddefs
"""Names and types of the fields of each message; those of the messages used here are the same in
all distributions of ROS 2."""
PLAIN: dict[str, Message] = {
    "bool": bool,
    "float64": float64,
    "int32": int32,
    "string": str,
    "uint8": uint8,
    "uint32": uint32,
}
PICTURES = ("Image", "CompressedImage")
METRES = "32FC1"
DEPTHS: dict[str, tuple[type[np.number], float]] = {
    METRES: (np.float32, 1.0),
    "16UC1": (np.uint16, 1e-3),
}
"""Type and unit [m] of the numbers of each encoding of depth; 0 is an unknown depth."""
SECOND = 1_000_000_000
"""A second [ns]."""


@cache
def message(name: str) -> Message:
    """Return the DDS type (a class) of a ROS 2 message, given its name such as
    "sensor_msgs/Image".
    """
    package, _, short = name.partition("/")
    fields = {field: _type_of(*of) for field, of in FIELDS[f"{package}/msg/{short}"][1]}
    made: Message = make_idl_struct(short, f"{package}.msg.dds_.{short}_", fields)
    if short in PICTURES:  # as a sequence of numbers, a picture of 640 x 480 px would take 60 ms
        made.__idl__.populate()
        made.__idl__.v1_machine.members_machines["data"] = BytesMachine()
        made.__idl__.v2_machine.members_machines["data"] = BytesMachine()
    return made


def _type_of(node: Message, of: Message) -> Message:
    """Return the DDS type of a message's field, given its definition: a plain type, message, array
    or sequence.
    """
    match node.name:
        case "BASE":
            return PLAIN[of[0]]
        case "NAME":
            return message(of.replace("/msg/", "/"))
        case "ARRAY":
            return array[_type_of(*of[0]), of[1]]
        case _:
            return sequence[_type_of(*of[0])]


Image = message("sensor_msgs/Image")
CompressedImage = message("sensor_msgs/CompressedImage")
CameraInfo = message("sensor_msgs/CameraInfo")
RegionOfInterest = message("sensor_msgs/RegionOfInterest")
JointState = message("sensor_msgs/JointState")
TwistStamped = message("geometry_msgs/TwistStamped")
Clock = message("rosgraph_msgs/Clock")


def header(seconds: float, frame: str) -> Message:
    """Return a std_msgs/Header with a stamp [s], rounded to 1 ns, and the name of a coordinate
    frame.
    """
    stamp = message("builtin_interfaces/Time")(*divmod(round(seconds * SECOND), SECOND))
    return message("std_msgs/Header")(stamp, frame)


def seconds(stamp: Message) -> float:
    """Return the time in a builtin_interfaces/Time, which counts seconds and nanoseconds, as one
    number [s].
    """
    return stamp.sec + stamp.nanosec / SECOND


def stamped(twist: Array, at: Message) -> Message:
    """Return a geometry_msgs/TwistStamped with the std_msgs/Header `at` and a twist (6,): linear
    velocity [m/s], then angular velocity [rad/s].
    """
    linear, angular = map(message("geometry_msgs/Vector3"), *twist.reshape(2, 3).T.tolist())
    return TwistStamped(at, message("geometry_msgs/Twist")(linear, angular))


def depth_message(depth: DepthPicture, at: Message) -> Message:
    """Return a depth picture (H, W) [m] as a sensor_msgs/Image (ROS REP 118, encoding 32FC1) with
    the std_msgs/Header `at`.
    """
    height, width = depth.shape
    return Image(at, height, width, METRES, 0, 4 * width, depth.astype("<f4").tobytes())


def depth_of(message: Message, topic: str) -> DepthPicture:
    """Return the depth picture, float32 (H, W) [m], in a sensor_msgs/Image (ROS REP 118). An
    unknown depth, 0 in the message, becomes nan.

    Args:
        message: The sensor_msgs/Image.
        topic: Its topic, for error messages.

    Raises:
        Mistake: The encoding is neither 32FC1 [m] nor 16UC1 [mm], or the message has too little
            data for its size.
    """
    check_known([message.encoding], DEPTHS, topic, "encoding of depth")
    number, unit = DEPTHS[message.encoding]
    kind = np.dtype(number).newbyteorder(">" if message.is_bigendian else "<")
    shape = message.height, message.width
    try:
        values = np.ndarray(shape, kind, message.data, strides=(message.step, kind.itemsize))
    except ValueError as error:
        raise Mistake(
            f"{topic}: a depth picture has too little data for its width {message.width} px, "
            f"height {message.height} px and step {message.step} bytes ({error}): check its "
            "publisher"
        ) from error
    return np.where(values == 0, np.nan, values * unit).astype(np.float32)
