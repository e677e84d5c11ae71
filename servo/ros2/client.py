"""Clients of a camera and of a robot in ROS 2, with which a control loop in Python drives them."""

import math
import time
from collections import deque

import mujoco
import numpy as np
from cyclonedds.util import duration

import sim.types as values
from servo.loop.episode import Episode
from servo.mistake import Mistake, check_known
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
KEPT = 2000
"""Number of joint states that are kept to find the one nearest to a picture's stamp: two seconds of
the fastest drivers, 1 kHz."""
SILENT = 1.0
"""Longest time without a new joint state [s]: any robot's driver sends ten a second or more. A
stamp that is earlier by more says that a clock was set back."""


class Camera:
    """Client of a camera in ROS 2: subscribes to its pictures (topic `image`, sensor_msgs/Image),
    its calibration (topic `info`, sensor_msgs/CameraInfo) and, if `depth` is given, its depth
    pictures (topic `depth`, sensor_msgs/Image).

    The message type of a topic `image` that ends with /compressed is CompressedImage. A depth
    picture (ROS REP 118) must have the size of its picture, and a stamp within 10 ms of its stamp.
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
        """Wait for the next message with the camera's calibration, and return the camera's
        intrinsics [px] and distortion.

        Raises:
            Mistake: No calibration has come within 10 s, a value in it is wrong, its distortion
                model is unknown, or its region of interest is not the whole picture.
        """
        return camera_of_info(first(self._info, self._topic), self._topic)

    def newest(self) -> Frame | None:
        """Return the newest picture, RGB, with its stamp as time [s], the number of pictures that
        this client received before it, and its depth picture [m]. Return None if no picture comes
        within 20 ms, or only one whose stamp is not later than that of the last one returned, by
        less than 1 s: beyond, the camera's clock was set back.

        The depth picture is None if the camera has none, or if none with the picture's stamp comes
        within 20 ms; nan in it stands for unknown depth.

        Raises:
            ValueError: The picture or depth picture is damaged, or has an unknown encoding.
        """
        for message in self._pictures.take_iter(timeout=WAITS):
            stamp = seconds(message.header.stamp)
            if self._last - SILENT <= stamp <= self._last:
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
    """Client of a robot in ROS 2, whose kinematic model is the robot of a scenario: reads joint
    states (topic `joints`, sensor_msgs/JointState), and sends camera twists (topic `twist`,
    geometry_msgs/TwistStamped) [m/s, rad/s] in the camera's optical frame, which ROS calls `frame`.
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
        self._states = deque[JointState](maxlen=KEPT)
        self._stamp = -math.inf
        """The stamp of the last joint state received [s]."""
        self._since = math.nan
        """This computer's monotonic time at which this stamp was read first [s]."""

    def posture(self, time: float) -> Posture:
        """Return the robot's posture (camera pose, joint positions and limits, Jacobian, camera
        twist) by the received joint state whose stamp is nearest to the time of a picture [s since
        1970].

        The camera twist is in the camera's frame [m/s, rad/s]: the mean from the joint state of the
        previous call to this one, zero at the first call and if the joint state is no newer.

        Raises:
            Mistake: No first joint state has come within 10 s or no further one for 1 s, it lacks a
                joint of the model, or it has another number of positions than of names.
        """
        for state in self._reader.take(KEPT):
            # A sample without data says that a publisher has left.
            if isinstance(state, JointState):
                self._keep(state)
        if not self._states:
            self._states.append(first(self._reader, self._topic))
        self._check_going_on(seconds(self._states[-1].header.stamp))
        state = min(self._states, key=lambda s: abs(seconds(s.header.stamp) - time))
        if len(state.position) != len(state.name):
            raise Mistake(
                f"{self._topic}: a joint state has {len(state.name)} names and "
                f"{len(state.position)} positions: send a position for each joint"
            )
        positions = dict(zip(state.name, state.position, strict=True))
        check_known(self._robot.names, positions, self._topic, "joint")
        self._data.qpos[self._robot.qpos] = [positions[name] for name in self._robot.names]
        self._robot.refresh(self._data)
        return self._robot.posture(self._data, self._twist(seconds(state.header.stamp)))

    def _keep(self, state: JointState) -> None:
        """Keep a joint state; if the robot's clock was set back, forget the earlier ones, whose
        stamps mean other times.
        """
        if self._states:
            back = seconds(self._states[-1].header.stamp) - seconds(state.header.stamp)
            if back > SILENT:
                self._states.clear()
        self._states.append(state)

    def _check_going_on(self, last: float) -> None:
        """Check that joint states go on coming, by the stamp [s] of the last one: the robot's clock
        may differ from this computer's.

        Raises:
            Mistake: The stamp is as long ago as joint states may stay away.
        """
        now = time.monotonic()
        if last != self._stamp:
            self._stamp, self._since = last, now
        elif now - self._since > SILENT:
            raise Mistake(
                f"{self._topic}: no new joint state has come for {SILENT:g} s: is the program that "
                "publishes on this topic still running?"
            )

    def go(self, twist: Array) -> None:
        """Send the robot a camera twist (6,): linear velocity [m/s], then angular velocity [rad/s],
        both in the camera's optical frame.

        Raises:
            Mistake: The twist is not six finite numbers; then nothing is sent.
        """
        finite = np.array(numbers(twist, "go", 6))
        self._writer.write(stamped(finite, header(time.time(), self._frame)))

    def clock(self) -> float:
        """Return this computer's time [s since 1970], with which the stamps of the twists are
        made.
        """
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
