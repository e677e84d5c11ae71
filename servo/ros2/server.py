"""A simulated camera and robot for somebody's own controller in ROS 2, in real time."""

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
"""Time without a twist after which the robot stops by itself [s]."""
FRAME = "camera"
WHOLE = RegionOfInterest(0, 0, 0, 0, False)
"""ROS's word for all of a picture."""


class Server:
    """The controller of a run, which takes the twists of ROS 2, and the sink that serves its steps.

    The run's time begins with the first twist. A picture is out at its time; the twist that is
    there one frame interval later acts from then on.
    """

    SETTINGS = ("tracker.kind=truth", "estimator.kind=none", "run.latency=0")
    """Of a run whose tracker and law are elsewhere."""
    UNUSED = ("run.latency", "run.latency_ms")
    """A twist acts when it comes."""

    def __init__(self) -> None:
        """Begin to listen."""
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
        """Those that were printed."""

    def serving(self, episode: Episode) -> Self:
        """Serve this run from now on, whose camera is as it is believed to be; return this."""
        self._camera = episode.world.camera_believed
        self._names = list(episode.world.robot.names)
        return self

    def start(self, task: Task) -> None:
        """Begin a task, which is not known here."""

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the newest twist; zeros where it is too old, or was refused."""
        self._listen()
        is_new = time.monotonic() < self._heard + DEAD_MAN
        return Command(self._twist if is_new else np.zeros(6))

    def add(self, step: Step) -> None:
        """Serve a step, and wait until it is time for the next one."""
        self._publish(step)
        if self._began is None:
            sys.stderr.write(f"waiting for a twist on {TOPIC}\n")
            while not self._listen():
                time.sleep(step.scene.period)
                self._publish(step)
            self._began = time.monotonic() - step.frame.time
        due = self._began + step.frame.time + step.scene.period
        time.sleep(max(0.0, due - time.monotonic()))

    def close(self) -> None:
        """End; the topics end with the process."""

    def abandon(self) -> None:
        """End after an error, likewise."""

    def _listen(self) -> bool:
        """Take the newest twist, if one has come; one that is refused stops the robot, and is said
        once.
        """
        for message in self._twists.take(1):
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

    def _publish(self, step: Step) -> None:
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
    """Return the reason why a twist (6,) is not driven; empty where it is."""
    if frame not in ("", FRAME):
        return (
            f"a twist in the frame '{frame}' is not driven: it has to be in the camera's optical "
            f"frame '{FRAME}' (header.frame_id)"
        )
    return "" if np.isfinite(twist).all() else "a twist that is not finite is not driven"
