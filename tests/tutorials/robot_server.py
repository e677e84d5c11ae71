"""A simulated robot with a camera in a process of its own, whose clock does not wait for anybody.

It prints its port. The first connection is the camera's, the second the robot's; all messages are
JSON or pixels (no pickle: what comes in is never executed).

    camera  ->  {"time", "index", "height", "width"}, then the pixels, RGB; 30 a second
    robot   <-  {"ask": "posture", "time"}  the answer: what it knew of itself at this time
            <-  {"ask": "twist", "twist"}   camera twist (6,), held until the next one
            <-  {"ask": "clock"}            the answer: its time now
            <-  {"ask": "log"}              time, speed and true error of each tick so far

At a time that is given somebody pulls the camera's cable: it stays connected and is silent. The
target starts with the first twist. The server ends when the robot's connection is closed.
"""

import json
import sys
import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection, Listener

import numpy as np

import servo

DEAD_MAN = 0.3
"""Without a twist for so long the robot stops by itself, whatever became of its user [s]."""


class Robot:
    def __init__(self, world, unplugged: float, camera: Connection, link: Connection) -> None:
        self.world, self.camera, self.link = world, camera, link
        self.twist, self.heard = np.zeros(6), None
        self.log, self.postures = [], []
        self.unplugged, self.picture = unplugged, None
        self.fresh = threading.Condition()
        threading.Thread(target=self.show, daemon=True).start()

    def show(self) -> None:
        """The camera: sends the newest picture; it is a thread, so that nobody holds up the robot
        who does not fetch pictures.
        """
        frame = None
        while True:
            with self.fresh:
                self.fresh.wait_for(lambda sent=frame: self.picture is not sent)
                frame = self.picture
            height, width = frame.image.shape[:2]
            head = {"time": frame.time, "index": frame.index, "height": height, "width": width}
            self.camera.send_bytes(json.dumps(head).encode())
            self.camera.send_bytes(frame.image.tobytes())

    def run(self) -> None:
        while True:
            self.tick()
            acting, due = self.acting(), time.monotonic() + self.world.period
            while self.link.poll(max(0.0, due - time.monotonic())):
                self.answer(json.loads(self.link.recv_bytes()))
            if self.heard is not None:
                self.world.step(acting)

    def tick(self) -> None:
        """Take a picture, and note the posture and, for the log, the truth."""
        frame, posture, truth = self.world.look(), self.world.posture(), self.world.truth()
        middle = self.world.camera.width / 2, self.world.camera.height / 2
        error = float(np.linalg.norm(truth.centre - middle))
        self.log.append((frame.time, float(np.linalg.norm(posture.twist[:3])), error))
        self.postures = [*self.postures[-60:], (frame.time, posture)]
        last = -1.0 if self.picture is None else self.picture.time
        if last < frame.time < self.unplugged:
            with self.fresh:
                self.picture = frame
                self.fresh.notify()

    def acting(self) -> np.ndarray:
        """The newest twist, unless it is too old."""
        now = self.log[-1][0]
        if self.heard is None or now - self.heard > DEAD_MAN:
            return np.zeros(6)
        return self.twist

    def answer(self, message: dict) -> None:
        match message["ask"]:
            case "twist":
                self.twist, self.heard = np.array(message["twist"]), self.log[-1][0]
            case "posture":
                _, posture = min(self.postures, key=lambda p: abs(p[0] - message["time"]))
                self.send(described(posture))
            case "unplug" | "plug":
                self.plugged = message["ask"] == "plug"
                self.send(self.log[-1][0])
            case "clock":
                self.send(self.log[-1][0])
            case "log":
                self.send(self.log)

    def send(self, answer: object) -> None:
        self.link.send_bytes(json.dumps(answer).encode())


def described(posture: servo.Posture) -> dict:
    pose = posture.T_base_camera
    names = ("twist", "joints", "lower", "upper", "jacobian", "accepted")
    arrays = {name: getattr(posture, name).tolist() for name in names}
    return arrays | {"R": pose.rotation.tolist(), "t": pose.translation.tolist()}


if __name__ == "__main__":
    with servo.Episode(servo.load(sys.argv[1])) as episode, Listener(("127.0.0.1", 0)) as door:
        print(door.address[1], flush=True)
        with suppress(EOFError, ConnectionError):  # the user has gone
            Robot(episode.world, float(sys.argv[2]), door.accept(), door.accept()).run()
