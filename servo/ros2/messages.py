"""The messages of ROS 2 that a servo loop needs, field by field as their packages define them."""

from dataclasses import dataclass, field
from typing import Annotated, Any

from cyclonedds.idl import IdlStruct
from cyclonedds.idl._machinery import BytesMachine
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32

from sim.types import Array

DOUBLE: Any = float64
BYTE: Any = uint8
Texts = Annotated[list[str], sequence(str)]
Numbers = Annotated[list[float], sequence(DOUBLE)]
Nine = Annotated[list[float], array(DOUBLE, 9)]
Bytes = Annotated[bytes, sequence(BYTE)]
Twelve = Annotated[list[float], array(DOUBLE, 12)]
SECOND = 1_000_000_000
"""In nanoseconds."""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    """A moment."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    """When and in which frame something is."""

    stamp: Time
    frame_id: str


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs.msg.dds_.Clock_"):
    """The simulated time."""

    clock: Time


@dataclass
class Image(IdlStruct, typename="sensor_msgs.msg.dds_.Image_"):
    """A picture; its bytes are a sequence of uint8."""

    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: Bytes


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs.msg.dds_.CompressedImage_"):
    """A picture as JPEG or PNG."""

    header: Header
    format: str
    data: Bytes


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs.msg.dds_.RegionOfInterest_"):
    """A part of a picture."""

    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool = False


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs.msg.dds_.CameraInfo_"):
    """A camera's calibration; the first pixel's middle is at zero."""

    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: Numbers
    k: Nine
    r: Nine
    p: Twelve
    binning_x: uint32 = 0
    binning_y: uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)


@dataclass
class JointState(IdlStruct, typename="sensor_msgs.msg.dds_.JointState_"):
    """Positions and velocities of joints by their names."""

    header: Header
    name: Texts
    position: Numbers
    velocity: Numbers
    effort: Numbers


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    """A direction with a length."""

    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    """A velocity and a turn rate."""

    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TwistStamped_"):
    """A twist in a frame."""

    header: Header
    twist: Twist


def _with_bytes(kind: Any) -> None:
    """Let pictures stay bytes: as a sequence of numbers, one of 640 x 480 px would take 60 ms."""
    kind.__idl__.populate()
    for machine in (kind.__idl__.v1_machine, kind.__idl__.v2_machine):
        machine.members_machines["data"] = BytesMachine()


_with_bytes(Image)
_with_bytes(CompressedImage)


def header(seconds: float, frame: str) -> Header:
    """Return the header of a moment [s]."""
    return Header(Time(*divmod(round(seconds * SECOND), SECOND)), frame)


def seconds(stamp: Time) -> float:
    """Return a moment [s]."""
    return stamp.sec + stamp.nanosec / SECOND


def stamped(twist: Array, at: Header) -> TwistStamped:
    """Return the message of a twist (6,)."""
    x, y, z, *turn = twist.tolist()
    return TwistStamped(at, Twist(Vector3(x, y, z), Vector3(*turn)))
