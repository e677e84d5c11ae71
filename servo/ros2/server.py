"""A simulated camera and robot in ROS 2, which a controller in another process drives in real
time.
"""

import sys
import time
from contextlib import suppress
from typing import Self

import numpy as np
from cyclonedds.core import DDSException

from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.parts import Task
from servo.ros2.messages import (
    CameraInfo,
    Clock,
    Image,
    JointState,
    RegionOfInterest,
    TwistStamped,
    depth_message,
    header,
)
from servo.ros2.node import Node
from servo.scenario.calibration import camera_info
from servo.types import Command, Sight
from sim.types import Array, Posture

TOPIC = "/servo/twist"
DEAD_MAN = 0.3
"""Time without a twist after which the robot stops [s]."""
FRAME = "camera"
WHOLE = RegionOfInterest(0, 0, 0, 0, False)
"""The region of interest that stands for the whole picture."""


class Server:
    """A simulated camera and robot that a controller in another process drives by ROS 2, in real
    time.

    A run uses one object of this class as its controller, which commands the twists received by ROS
    2, and as an output, which publishes each step (picture, joints, ...) to ROS 2. The run's time
    begins with the first valid twist. Each picture is published at its time; the newest twist that
    has come one frame interval later moves the camera from then on.
    """

    SETTINGS = ("tracker.kind=truth", "estimator.kind=none", "run.latency=0")
    """Settings of a run whose tracker and law are in another process."""
    UNUSED = ("run.latency", "run.latency_ms")
    """Settings that have no effect, because a twist acts when it arrives."""

    def __init__(self) -> None:
        """Subscribe to twists, and advertise the camera and the robot."""
        node = Node()
        self._twists = node.reader(TOPIC, TwistStamped)
        self._images = node.writer("/camera/image_raw", Image)
        self._depths = node.writer("/camera/depth/image_raw", Image)
        self._info = node.writer("/camera/camera_info", CameraInfo)
        self._joints = node.writer("/joint_states", JointState)
        self._clock = node.writer("/clock", Clock)
        self._twist = np.zeros(6)
        self._heard = -DEAD_MAN
        self._began: float | None = None
        self._refusals = set[str]()
        """Refusals that were printed."""

    def serving(self, episode: Episode) -> Self:
        """Store what `add` publishes beside the steps of an episode: the robot's joint names, and
        the camera calibration that a controller is to assume. Return this server.
        """
        self._camera = episode.world.camera_believed
        self._names = list(episode.world.robot.names)
        return self

    def start(self, task: Task) -> None:
        """Do nothing: the controller in the other process does not need the task of the run (goal,
        features, estimator).
        """

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the newest camera twist (6,) from ROS 2, in the camera's frame [m/s, rad/s]. It is
        zero if none has come in the last 0.3 s, or if the newest was refused (another frame, or a
        number that is not finite). The arguments are not used.
        """
        self._listen()
        is_new = time.monotonic() < self._heard + DEAD_MAN
        return Command(self._twist if is_new else np.zeros(6))

    def add(self, step: Step) -> None:
        """Publish a step of the run (time, calibration, joints, depth picture, picture), and wait
        in real time until the next step is due. The first step is published again every frame
        interval until a valid twist arrives.
        """
        self.publish(step)
        if self._began is None:
            sys.stderr.write(f"waiting for a twist on {TOPIC}\n")
            while not self._listen():
                time.sleep(step.scene.period)
                self.publish(step)
            self._began = time.monotonic() - step.frame.time
        due = self._began + step.frame.time + step.scene.period
        time.sleep(max(0.0, due - time.monotonic()))

    def close(self) -> None:
        """Do nothing at the end of a run: the topics end with the process."""

    def abandon(self) -> None:
        """Do nothing; called when a run ends with an error. The topics end with the process."""

    def _listen(self) -> bool:
        """Read the newest twist; return True if there is one and it is valid.

        An invalid twist stops the robot; each reason is printed once.
        """
        for message in self._twists.take(1):
            if not isinstance(message, TwistStamped):
                continue  # a sample without data: a sender has left
            parts = message.twist.linear, message.twist.angular
            twist = np.array([[part.x, part.y, part.z] for part in parts]).ravel()
            wrong = _wrong(twist, message.header.frame_id)
            self._twist = np.zeros(6) if wrong else twist
            self._heard = time.monotonic()
            if wrong and wrong not in self._refusals:
                self._refusals.add(wrong)
                sys.stderr.write(f"{TOPIC}: {wrong}\n")
            return not wrong
        return False

    def publish(self, step: Step) -> None:
        """Send a step of the run to its topics of ROS 2: time, calibration, joint positions and
        rates, depth picture (if the step has one) and picture, in this order. If a reader is too
        slow, the rest of the step is left out.
        """
        at = header(step.frame.time, FRAME)
        image = step.frame.image
        height, width, _ = image.shape
        robot = step.posture.joints.tolist(), step.rates.tolist()
        with suppress(DDSException):  # a reader is too slow; it gets the next one
            self._clock.write(Clock(at.stamp))
            self._info.write(CameraInfo(at, **camera_info(self._camera), roi=WHOLE))
            self._joints.write(JointState(at, self._names, *robot, []))
            if step.frame.depth is not None:
                self._depths.write(depth_message(step.frame.depth, at))
            self._images.write(Image(at, height, width, "rgb8", 0, 3 * width, image.tobytes()))


def _wrong(twist: Array, frame: str) -> str:
    """Return why a twist (6,) in a coordinate frame is refused; an empty text if it is valid."""
    if frame not in ("", FRAME):
        return (
            f"a twist in the frame '{frame}' is refused: it has to be in the camera's optical "
            f"frame '{FRAME}' (header.frame_id)"
        )
    if not np.isfinite(twist).all():
        return "a twist with a number that is not finite is refused: send six finite numbers"
    return ""
