# %% [markdown]
# # A real robot
#
# `servo.Loop` knows no world: pictures and postures go in, camera twists come out. Here camera and
# robot are another process behind a socket (`robot_server.py`: it steps one of our simulations, and
# its clock does not wait), so this program is what yours would be. What depends on the hardware is
# `Camera.newest`, `Robot.posture` and `Robot.go`.
#
# Safety has three places, none of which trusts the others:
#
# | place | what | here |
# |---|---|---|
# | the law | limits of what it asks for | `controller.fastest` in `SCENARIO` |
# | the driver, this file | limits; no motion where it is no number | `limited` |
# | | no picture for 0.2 s: stop | `drive` |
# | the robot's own controller | its limits, its emergency stop | yours |
# | | no command for 0.3 s: stop | `DEAD_MAN` in `robot_server.py` |
#
# %%
import json
import os
import subprocess
import sys
import time
from multiprocessing.connection import Client
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import servo

HERE = Path(__file__).parent if "__file__" in globals() else Path()
OUT = Path(os.environ.get("SERVOBENCH_TUTORIALS", "."))
NO_PICTURE = 0.2  # the robot stops where no picture has come for so long [s]
FASTEST, FASTEST_TURN = 0.4, 1.5  # of the camera, whatever the law asks for [m/s, rad/s]


# %%
class Camera:
    """With a webcam, let a thread call `VideoCapture.read`, which may never return."""

    def __init__(self, port: int) -> None:
        self.link = Client(("127.0.0.1", port))

    def newest(self) -> servo.Frame | None:
        """The newest picture; older ones are thrown away. None: there is none yet."""
        frame = None
        while self.link.poll(0.02 if frame is None else 0):
            head = json.loads(self.link.recv_bytes())
            pixels = np.frombuffer(self.link.recv_bytes(), np.uint8)
            image = pixels.reshape(head["height"], head["width"], 3)  # RGB; OpenCV has BGR
            frame = servo.Frame(image, head["time"], head["index"])
        return frame


class Robot:
    def __init__(self, port: int) -> None:
        self.link = Client(("127.0.0.1", port))

    def ask(self, what: str, **more: object):
        self.link.send_bytes(json.dumps({"ask": what, **more}).encode())
        return json.loads(self.link.recv_bytes()) if what != "twist" else None

    def posture(self, time: float) -> servo.Posture:
        """What the robot knew of itself when a picture was taken: they have one clock."""
        told = {name: np.array(value) for name, value in self.ask("posture", time=time).items()}
        return servo.Posture(servo.Pose(told.pop("R"), told.pop("t")), **told)

    def go(self, twist: np.ndarray) -> None:
        self.ask("twist", twist=limited(twist).tolist())


def limited(twist: np.ndarray) -> np.ndarray:
    """The twist, made slower where it is too fast; no motion where it is no number."""
    if not np.isfinite(twist).all():
        return np.zeros(6)
    over = np.linalg.norm(twist[:3]) / FASTEST, np.linalg.norm(twist[3:]) / FASTEST_TURN
    return twist / max(1.0, *over)


def drive(running: servo.Running, camera: Camera, robot: Robot, frame: servo.Frame | None) -> str:
    """Follow the target from a picture on, as long as pictures come; why it ended."""
    try:
        while frame is not None:
            robot.go(running.step(frame, robot.posture(frame.time)).twist)
            last = frame.time
            while (frame := camera.newest()) is None and robot.ask("clock") < last + NO_PICTURE:
                pass
        return f"no picture for {NO_PICTURE} s"
    finally:
        robot.go(np.zeros(6))  # whatever happened, an exception included


# %% [markdown]
# What the user knows: the camera's calibration, the target's rectangle, and where it is in the
# first picture ([conventions](../../servo/README.md#the-loop-without-a-world)). `run.latency` says
# that a command acts from the next picture on. The first call of a tracker compiles it, which may
# take 20 s: a rehearsal on the first picture does that before the robot moves.
#
# %%
CAMERA = servo.Camera(fx=289.7, fy=289.7, cx=160.0, cy=120.0, width=320, height=240)
OUTLINE = np.array([[-0.1, 0.05, 0], [0.1, 0.05, 0], [0.1, -0.05, 0], [-0.1, -0.05, 0]])
SCENARIO = servo.load("circle", ["controller.fastest=0.3", "run.latency=1"])
PULLED = 5.0  # when somebody pulls the camera's cable [s]


def started(first: servo.Frame) -> servo.Running:
    loop = servo.Loop(SCENARIO, CAMERA, OUTLINE)
    return loop.start(first, servo.Region(58.0, 29.0), servo.State(160.0, 120.0))


command = [sys.executable, HERE / "robot_server.py", "circle", str(PULLED)]
server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
port = int(server.stdout.readline())
camera, robot = Camera(port), Robot(port)
while (first := camera.newest()) is None:
    pass
rehearsal = started(first)
for k in range(2):
    rehearsal.step(servo.Frame(first.image, k / 30, k), robot.posture(first.time))

# %% [markdown]
# The robot follows until somebody pulls the cable: the driver stops it. Then this program sends a
# command and hangs: the robot stops by itself.
#
# %%
print(drive(started(first), camera, robot, first))


def hang(seconds: float) -> float:
    """Do nothing for so long, by the robot's clock; its time then."""
    end = robot.ask("clock") + seconds
    while (now := robot.ask("clock")) < end:
        time.sleep(0.05)
    return now


hung = hang(0.7)
robot.go(np.array([0.1, 0, 0, 0, 0, 0]))
hang(0.7)
times, speeds, errors = np.array(robot.ask("log")).T
for link in (camera.link, robot.link):
    link.close()
server.wait(120)  # at most, where a machine is busy [s]


# %%
def stopped_after(begin: float, end: float) -> float:
    """How long after an event the camera still moved [s]."""
    moving = times[(times > begin) & (times <= end) & (speeds > 0.005)]
    return moving.max(initial=begin) - begin


follows = (times > 1.5) & (times < PULLED)
rms = np.sqrt(np.mean(errors[follows] ** 2))
print(f"followed within {rms:.2f} px at {speeds[follows].mean():.3f} m/s")
print(f"no picture: stopped after {stopped_after(PULLED, hung):.2f} s")
print(f"no command: stopped after {stopped_after(hung, times[-1]):.2f} s")
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
above.plot(times, errors)
above.set(ylabel="true error [px]", ylim=(0, 10))
below.plot(times, speeds)
below.set(ylabel="camera's speed [m/s]", xlabel="time [s]")
for moment, text in ((PULLED, "cable\npulled"), (hung, "program\nhangs")):
    below.axvline(moment, color="grey", linestyle=":")
    below.text(moment + 0.05, 0.16, text, va="top")
below.set_ylim(0, 0.17)
figure.savefig(OUT / "a_real_robot.png", dpi=120)
