"""A camera and a robot of ROS 2, for a loop of servobench that drives them."""

import math
import time

import mujoco
import numpy as np
from cyclonedds.util import duration

import sim.types as values
from servo.loop.episode import Episode
from servo.mistake import check_known
from servo.ros2.messages import (
    CameraInfo,
    CompressedImage,
    Image,
    JointState,
    TwistStamped,
    depth_of,
    header,
    seconds,
    stamped,
)
from servo.ros2.node import Node, first
from servo.scenario.arguments import numbers
from servo.scenario.calibration import camera_of_info
from servo.scenario.load import Scenario
from sim.files.bit_depth import BitDepth
from sim.geometry import log_se3
from sim.types import Array, DepthPicture, Frame, Pose, Posture
from tracking.sequences.image_message import picture_of

WAITS = duration(milliseconds=20)
"""Longest wait for a new picture."""
TOGETHER = 0.01
"""Largest difference between the stamps of a picture and its depth picture [s]."""
KEPT_DEPTHS = 5
"""Number of depth pictures that are kept to find the one with a picture's stamp."""
KEPT = 100
"""Number of joint states that are kept to find the one nearest to a picture's stamp."""


class Camera:
    """Client of a camera of ROS 2: reads its pictures (topic `image`, sensor_msgs/Image), its
    calibration (`info`, CameraInfo) and, if `depth` is given, its depth pictures.

    A topic that ends with /compressed has CompressedImage. A depth picture is a sensor_msgs/Image
    with the same size and stamp as the picture (ROS REP 118).
    """

    def __init__(
        self,
        image: str = "/camera/image_raw",
        info: str = "/camera/camera_info",
        depth: str | None = None,
    ) -> None:
        """Subscribe to the camera's topics.

        Args:
            image: Topic of the pictures.
            info: Topic of the calibration.
            depth: Topic of the depth pictures, if there are any.
        """
        node = Node()
        kind = CompressedImage if image.endswith("/compressed") else Image
        self._pictures = node.reader(image, kind)
        self._info = node.reader(info, CameraInfo)
        self._depths = node.reader(depth, Image, KEPT_DEPTHS) if depth else None
        self._depth_topic = depth or ""
        self._topic = info
        self._bits = BitDepth()
        self._count = 0
        self._last = -math.inf

    def calibration(self) -> values.Camera:
        """Wait for the camera's calibration and return it.

        Raises:
            Mistake: No calibration has come within 10 s, its distortion model is unknown, or it
                does not belong to the whole picture.
        """
        return camera_of_info(first(self._info, self._topic), self._topic)

    def newest(self) -> Frame | None:
        """Return the newest picture, or None if no newer one than the last returned comes within 20
        ms. It has its depth picture, if there is a topic of these and the one with this stamp comes
        within 20 ms.

        Raises:
            ValueError: A picture or depth picture is damaged or has an unknown encoding.
        """
        for message in self._pictures.take_iter(timeout=WAITS):
            stamp = seconds(message.header.stamp)
            if stamp <= self._last:
                return None  # a simulation that waits for a twist sends its first picture again
            self._last = stamp
            self._count += 1
            _, image = picture_of(lambda _, found=message: found, b"", self._bits)
            return Frame(image, stamp, self._count - 1, depth=self._depth(stamp))
        return None

    def _depth(self, stamp: float) -> DepthPicture | None:
        """Return the depth picture (H, W) [m] with a stamp [s], or None if it does not come within
        20 ms.
        """
        if self._depths is None:
            return None
        for message in self._depths.take_iter(timeout=WAITS):
            if abs(seconds(message.header.stamp) - stamp) <= TOGETHER:
                return depth_of(message, self._depth_topic)
        return None


class Robot:
    """Client of a robot of ROS 2, whose model is that of a scenario: reads sensor_msgs/JointState
    (topic `joints`), and sends geometry_msgs/TwistStamped (topic `twist`) in the camera's optical
    frame, named `frame` [m/s, rad/s].
    """

    def __init__(
        self,
        scenario: Scenario,
        joints: str = "/joint_states",
        twist: str = "/servo/twist",
        frame: str = "camera",
    ) -> None:
        """Subscribe to joint states, and advertise twists.

        Args:
            scenario: A scenario whose `[robot]` is the model of the robot, with its joints' names.
            joints: Topic of the joint states.
            twist: Topic of the camera's twists.
            frame: Name of the camera's optical frame, in which the twists are given.
        """
        with Episode(scenario) as episode:
            self._robot = episode.world.robot
        self._data = mujoco.MjData(self._robot.model)
        node = Node()
        self._reader = node.reader(joints, JointState, KEPT)
        self._writer = node.writer(twist, TwistStamped)
        self._topic = joints
        self._frame = frame
        self._last: tuple[float, Pose] | None = None

    def posture(self, time: float) -> Posture:
        """Return the robot's posture at the stamp of a picture [s], from the nearest joint state.
        The posture's twist is the mean since the posture of the previous call, at first zero.

        Raises:
            Mistake: No joint state has come within 10 s, or it lacks a joint of the model.
        """
        states = self._reader.read(KEPT) or [first(self._reader, self._topic)]
        state = min(states, key=lambda s: abs(seconds(s.header.stamp) - time))
        positions = dict(zip(state.name, state.position, strict=True))
        check_known(self._robot.names, positions, self._topic, "joint")
        self._data.qpos[self._robot.qpos] = [positions[name] for name in self._robot.names]
        self._robot.refresh(self._data)
        return self._robot.posture(self._data, self._twist(seconds(state.header.stamp)))

    def go(self, twist: Array) -> None:
        """Send a twist (6,) of the camera, in its own frame [m/s, rad/s], to the robot.

        Raises:
            Mistake: The twist is not six finite numbers; then nothing is sent.
        """
        finite = np.array(numbers(twist, "go", 6))
        self._writer.write(stamped(finite, header(time.time(), self._frame)))

    def clock(self) -> float:
        """Return the current time [s] on the clock of the stamps, that of this computer."""
        return time.time()

    def _twist(self, now: float) -> Array:
        """Return the mean camera twist (6,), in the camera's frame [m/s, rad/s], from the last
        posture to that of the time `now` [s].
        """
        pose = self._robot.eye(self._data)
        before = self._last
        self._last = now, pose
        if before is None or now <= before[0]:
            return np.zeros(6)
        return log_se3(before[1].inverse() @ pose) / (now - before[0])
