"""The drivers of the tutorial drivers.md, against stand-ins with the packages' signatures.

Those of ur_rtde 1.6.5 are its own docstrings', those of LeRobot 0.4.4 and 0.6.1 their class `Robot`.
"""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tutorial_pages import saved_files, script

import servo
from servo.twin.corrections import motion as motion_of
from servo.twin.readings import TWIST as TWIST_COLUMNS
from servo.twin.readings import hand_log, is_camera, log_table
from sim.geometry import exp_se3, exp_so3, log_se3
from sim.types import Pose

PAGE = Path(__file__).parents[1] / "servo" / "tutorials" / "drivers.md"
ROBOT_PAGE = PAGE.with_name("a_real_robot.md").read_text()
SCENARIO = servo.load("arm_line", ["camera.rate=30"])
TWIST = np.array([0.05, -0.03, 0.02, 0.1, -0.2, 0.15])
T_TCP_CAMERA = Pose(exp_so3(np.array([0.3, -0.2, 1.2])), np.array([0.04, -0.06, 0.09]))
HOME = Pose(exp_so3(np.array([2.9, 0.4, -0.3])), np.array([0.4, -0.1, 0.5]))
"""T_base_tcp of the stand-in."""
STEP = 1e-3
"""Time in which the stand-in moves [s]."""


class Ur:
    """A controller: it knows where its TCP is and how that moves."""

    T_base_tcp = HOME
    speed = (0.0,) * 6
    calls: tuple[str, ...] = ()


class RTDEReceiveInterface:
    def __init__(
        self,
        hostname: str,
        frequency: float = -1.0,
        variables: tuple[str, ...] = (),
        verbose: bool = False,
        use_upper_range_registers: bool = False,
        rt_priority: int = 0,
    ) -> None:
        assert hostname == "192.0.2.1"

    def getActualQ(self) -> list[float]:
        return [0.1, -1.0, 1.2, -1.6, -1.5, 0.2]

    def getActualTCPPose(self) -> list[float]:
        pose = Ur.T_base_tcp
        return [*pose.translation, *Rotation.from_matrix(pose.rotation).as_rotvec()]

    def getActualTCPSpeed(self) -> list[float]:
        return list(Ur.speed)

    def disconnect(self) -> None:
        Ur.calls += ("disconnect",)


class RTDEControlInterface:
    takes = True

    def __init__(
        self,
        hostname: str,
        frequency: float = -1.0,
        flags: int = 1,
        ur_cap_port: int = 50002,
        rt_priority: int = 0,
    ) -> None:
        assert hostname == "192.0.2.1"

    def setWatchdog(self, min_frequency: float = 10.0) -> bool:
        Ur.calls += (f"setWatchdog {min_frequency}",)
        return True

    def kickWatchdog(self) -> bool:
        Ur.calls += ("kickWatchdog",)
        return True

    def speedL(self, xd: list[float], acceleration: float = 0.25, time: float = 0.0) -> bool:
        """Move the TCP for a moment: velocity of the point, and angular velocity, in the base."""
        assert type(xd) is list
        assert 0 < acceleration <= 2
        if not self.takes:
            return False
        v, w = np.reshape(xd, (2, 3)) * STEP
        before = Ur.T_base_tcp
        Ur.T_base_tcp = Pose(exp_so3(w) @ before.rotation, before.translation + v)
        Ur.speed = tuple(xd)
        return True

    def speedStop(self, a: float = 10.0) -> bool:
        Ur.calls += ("speedStop",)
        return True

    def stopScript(self) -> None:
        Ur.calls += ("stopScript",)

    def disconnect(self) -> None:
        Ur.calls += ("disconnect",)


def driver(file: str) -> ModuleType:
    """The module that the page says to save."""
    module = ModuleType(file)
    exec(compile(saved_files(PAGE.read_text())[file], file, "exec"), module.__dict__)
    return module


@pytest.fixture
def ur(monkeypatch: pytest.MonkeyPatch):
    """The driver of a UR arm at HOME."""
    for name, part in (
        ("rtde_control", RTDEControlInterface),
        ("rtde_receive", RTDEReceiveInterface),
    ):
        module = ModuleType(name)
        setattr(module, part.__name__, part)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(Ur, "T_base_tcp", HOME)
    monkeypatch.setattr(Ur, "speed", (0.0,) * 6)
    monkeypatch.setattr(Ur, "calls", ())
    return driver("ur_robot.py").Robot("192.0.2.1", SCENARIO, T_TCP_CAMERA)


@pytest.mark.wide
def test_the_camera_of_a_ur_arm_makes_the_twist_that_is_asked_for(ur) -> None:
    before = HOME @ T_TCP_CAMERA
    ur.go(TWIST)
    after = Ur.T_base_tcp @ T_TCP_CAMERA
    assert log_se3(before.inverse() @ after) / STEP == pytest.approx(TWIST, abs=1e-4)
    assert Ur.calls == ("setWatchdog 5.0", "kickWatchdog")


def test_a_ur_arm_reports_its_joints_and_the_cameras_twist(ur) -> None:
    ur.go(TWIST)
    posture = ur.posture(0.0)
    # The pose has changed since the speed was asked for, by the angle of a millisecond.
    assert posture.twist == pytest.approx(TWIST, abs=1e-4)
    assert posture.joints == pytest.approx(RTDEReceiveInterface("192.0.2.1").getActualQ())
    step = 1e-6 * np.arange(1.0, 7.0)
    with servo.Episode(SCENARIO) as episode:
        robot = episode.world.robot
    data = mujoco.MjData(robot.model)
    data.qpos[robot.qpos] = posture.joints + step
    robot.refresh(data)
    moved = log_se3(posture.T_base_camera.inverse() @ robot.eye(data))
    assert posture.jacobian @ step == pytest.approx(moved, abs=1e-10)


def test_a_ur_arm_that_refuses_ends_the_program(ur, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RTDEControlInterface, "takes", False)
    with pytest.raises(RuntimeError, match="the controller did not take the command"):
        ur.go(TWIST)
    ur.close()
    assert Ur.calls[-4:] == ("speedStop", "stopScript", "disconnect", "disconnect")


@pytest.mark.parametrize(
    ("asked", "let_through"),
    [
        (np.full(6, np.nan), np.zeros(6)),
        (np.array([np.inf, 0, 0, 0, 0, 0]), np.zeros(6)),
        (np.array([4.0, 0, 0, 0, 0, 1.0]), np.array([0.4, 0, 0, 0, 0, 0.1])),
    ],
)
def test_the_program_of_the_other_page_limits_what_a_driver_is_given(ur, asked, let_through):
    """However the robot is swapped; what it was given before the last zeros is looked at."""
    text = script(ROBOT_PAGE).split("CAMERA = ")[0]
    program = {"servo": servo, "np": np, "Camera": object, "Robot": object, "NO_PICTURE": 0.01}
    program |= {"FASTEST": 0.4, "FASTEST_TURN": 1.5}
    exec(text[text.index("def limited(") :], program)
    given = []
    go = ur.go
    ur.go = lambda twist: (given.append(twist), go(twist))
    running = SimpleNamespace(step=lambda frame, posture: servo.Command(asked))
    camera = SimpleNamespace(newest=lambda: None)
    frame = servo.Frame(np.zeros((2, 2, 3), np.uint8), ur.clock(), 0)
    assert program["drive"](running, camera, ur, frame) == "no picture for 0.01 s"
    assert given == [pytest.approx(let_through), pytest.approx(np.zeros(6))]
    assert np.isfinite(Ur.speed).all()


class LeRobot:
    """A robot of LeRobot whose joints are where they shall be at once, less what they hang."""

    def __init__(self, degrees: list[float], sag: float = 0.0) -> None:
        self.at = dict(zip("abcdef", degrees, strict=True))
        self.sag = sag
        self.images = 0
        self.is_connected = False
        self.stalls = False

    def connect(self, calibrate: bool = True) -> None:
        self.is_connected = True

    def get_observation(self) -> dict:
        assert self.is_connected
        if not self.stalls:
            self.picture = np.full((240, 320, 3), self.images, np.uint8)
            self.images += 1
        depth = {"hand_depth": self.depth} if hasattr(self, "depth") else {}
        return (
            depth
            | {f"{n}.pos": v for n, v in self.at.items()}
            | {
                "gripper.pos": 3.0,
                "hand": self.picture,
            }
        )

    def send_action(self, action: dict) -> dict:
        assert action.keys() == {f"{n}.pos" for n in self.at}
        self.at = {name.removesuffix(".pos"): v - self.sag for name, v in action.items()}
        return action

    def disconnect(self) -> None:
        self.is_connected = False


ZEROS = np.array([-0.2, -0.85, 1.2, 0.3, 0.2, 0.6])
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])


def lerobot(robot: LeRobot):
    """The driver of a robot of LeRobot."""
    return driver("lerobot_robot.py").Robot(robot, SCENARIO, "hand", list("abcdef"), ZEROS, SIGNS)


@pytest.mark.parametrize("sag", [0.0, 0.5])
def test_the_camera_of_lerobot_makes_the_twist_that_is_asked_for(sag: float) -> None:
    """Also where the joints hang half a degree below their goals."""
    arm = LeRobot([0.0] * 6, sag)
    made = lerobot(arm)
    made.newest()
    made.go(np.zeros(6))
    made.newest()
    before = made.posture(0.0).T_base_camera
    for _ in range(3):
        made.go(TWIST / 10)
        frame = made.newest()
    posture = made.posture(0.0)
    moved = log_se3(before.inverse() @ posture.T_base_camera)
    wanted = log_se3(exp_se3(TWIST / 10 * 3 / 30))
    assert moved == pytest.approx(wanted, abs=2e-5)
    assert posture.twist == pytest.approx(TWIST / 10, abs=1e-3)
    assert frame.index == 4
    assert frame.image[0, 0, 0] == 4
    made.close()
    assert not arm.is_connected


def test_a_picture_of_lerobot_that_was_seen_is_not_new() -> None:
    arm = LeRobot([0.0] * 6)
    made = lerobot(arm)
    assert made.newest() is not None
    arm.stalls = True
    assert made.newest() is None


def test_the_goal_of_lerobot_stays_near_a_joint_that_does_not_move() -> None:
    arm = LeRobot([0.0] * 6)
    made = lerobot(arm)
    made.newest()
    for _ in range(100):
        made.go(10 * TWIST)
    assert np.abs(made.goal - ZEROS).max() == pytest.approx(0.1)


def test_the_depths_of_lerobot_are_in_metres() -> None:
    arm = LeRobot([0.0] * 6)
    made = lerobot(arm)
    assert made.newest().depth is None
    arm.depth = np.array([[[835], [0]]], np.uint16)
    depth = made.newest().depth
    assert depth.dtype == np.float32
    assert depth == pytest.approx(np.array([[0.835, np.nan]]), nan_ok=True)


def test_the_log_that_a_driver_writes_is_read(tmp_path):
    module = ModuleType("robot_log")
    exec(saved_files(PAGE.read_text())["robot_log.py"], module.__dict__)
    times = np.arange(250) * 0.02
    twists = np.tile(TWIST, (len(times), 1))
    np.savetxt(
        tmp_path / "wiggle.csv", np.column_stack([times, twists]), delimiter=",", header="time"
    )
    ticks = iter(np.arange(10**6) * 0.01)
    robot = SimpleNamespace(
        clock=lambda: next(ticks),
        posture=lambda now: SimpleNamespace(T_base_camera=HOME @ exp_se3(TWIST * now)),
        go=lambda twist: None,
    )
    path = tmp_path / "log.csv"
    module.play(robot, str(tmp_path / "wiggle.csv"), str(path))
    table = log_table(path, None, None, None)
    motion = motion_of(hand_log(table, path, None).smooth)
    assert is_camera(table, path, None)
    middle = np.array([2.0])
    np.testing.assert_allclose(motion.twists(middle, middle + 0.1)[0], TWIST, atol=1e-4)
    assert [table[f"command_{name}"][9].as_py() for name in TWIST_COLUMNS] == TWIST.tolist()
