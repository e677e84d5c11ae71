"""ROS 2 over DDS: messages as it has them on the wire, a camera and a robot, and a run that is served.

Everything was tried against itself and against rosbags' serializer, not against a real ROS 2.
"""

import dataclasses
import importlib.util
import json
import os
import re
import sys
import time

import numpy as np
import pytest
from preloaded import SCRIPT, Command, ran

import servo
from servo.cli import run_command
from servo.mistake import Mistake
from sim.camera.distortion import Distortion

pytest.importorskip("cyclonedds", reason="the extra ros2 is not installed")
pytest.importorskip("rosbags", reason="the extra ros2 is not installed")

from rosbags.typesys import Stores, get_typestore

from servo.ros2 import Camera, Robot, messages, server
from servo.ros2.node import Node
from servo.scenario.calibration import camera_info, camera_of_info

LOOPBACK = """<CycloneDDS><Domain><General><Interfaces>
<NetworkInterface name="lo" multicast="false"/></Interfaces></General><Discovery>
<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>
</Discovery></Domain></CycloneDDS>"""
STORE = get_typestore(Stores.ROS2_HUMBLE)
AT = messages.header(12.25, "camera")
FISHEYE = servo.Camera(300.0, 310.0, 161.5, 119.0, 320, 240, Distortion("fisheye", (0.1, 0, 0, 0)))


def calibration(camera):
    """The message that tells a camera's calibration."""
    return messages.CameraInfo(AT, **camera_info(camera), roi=server.WHOLE)


EXAMPLES = {
    "sensor_msgs/msg/Image": messages.Image(AT, 2, 1, "rgb8", 0, 3, bytes(range(6))),
    "sensor_msgs/msg/CompressedImage": messages.CompressedImage(AT, "jpeg", b"abc"),
    "sensor_msgs/msg/CameraInfo": calibration(FISHEYE),
    "sensor_msgs/msg/JointState": messages.JointState(AT, ["a", "bc"], [1.0, 2.0], [3.0], []),
    "geometry_msgs/msg/TwistStamped": messages.stamped(np.arange(6.0), AT),
    "rosgraph_msgs/msg/Clock": messages.Clock(AT.stamp),
}


@pytest.fixture(scope="module", autouse=True)
def alone():
    """A domain of this process, on this machine only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CYCLONEDDS_URI", LOOPBACK)
        patch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 200))
        yield


def of_rosbags(message, name):
    """The same message as an object of rosbags."""
    fields = dict(STORE.fielddefs[name][1])
    values = {}
    for field in dataclasses.fields(message):
        value, (node, of) = getattr(message, field.name), fields[field.name]
        if node.name == "NAME":
            value = of_rosbags(value, of)
        elif node.name != "BASE" and of[0][1][0] != "string":
            kind = of[0][1][0]
            value = (
                np.frombuffer(value, kind) if isinstance(value, bytes) else np.array(value, kind)
            )
        values[field.name] = value
    return STORE.types[name](**values)


def given(reader, write, message):
    """Write a message until a function returns something."""
    for _ in range(100):
        write(message)
        found = reader()
        if found is not None:
            return found
        time.sleep(0.05)
    raise AssertionError("nothing came")


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_message_has_the_bytes_that_rosbags_writes(name):
    message = EXAMPLES[name]
    expected = bytes(STORE.serialize_cdr(of_rosbags(message, name), name))
    written = message.serialize()
    assert written[:2] == expected[:2] == b"\x00\x01"
    assert written[4:].rstrip(b"\0") == expected[4:].rstrip(b"\0")  # both may be padded
    assert type(message).deserialize(written) == message
    package, _, short = name.partition("/msg/")
    assert type(message).__idl__.idl_transformed_typename == f"{package}::msg::dds_::{short}_"


def test_a_camera_gives_pictures_in_rgb_with_their_stamps():
    camera = Camera("/a/image")
    image = messages.Image(AT, 1, 2, "bgr8", 0, 6, bytes([1, 2, 3, 4, 5, 6]))
    writer = Node().writer("/a/image", messages.Image)
    frame = given(camera.newest, writer.write, image)
    assert (frame.time, frame.index) == (12.25, 0)
    assert frame.image.tolist() == [[[3, 2, 1], [6, 5, 4]]]
    writer.write(image)
    time.sleep(0.2)
    assert camera.newest() is None  # it is not newer
    image.header = messages.header(12.5, "camera")
    assert given(camera.newest, writer.write, image).time == 12.5
    image.header = messages.header(3.0, "camera")  # the camera's clock was set back
    assert given(camera.newest, writer.write, image).time == 3.0


METRES = np.array([[0.5, np.nan], [1.25, 2.0]], np.float32)
MILLIMETRES = np.array([[500, 0], [1250, 2000]], ">u2")


@pytest.mark.parametrize(
    "message",
    [
        messages.depth_message(METRES, AT),
        messages.Image(
            AT, 2, 2, "16UC1", 1, 5, b"".join(row.tobytes() + b"-" for row in MILLIMETRES)
        ),
    ],
    ids=["32FC1", "16UC1"],
)
def test_a_depth_picture_belongs_to_the_picture_of_its_moment(message):
    camera = Camera("/d/image", depth="/d/depth")
    pictures = Node().writer("/d/image", messages.Image)
    depths = Node().writer("/d/depth", messages.Image)
    late = messages.depth_message(np.full((2, 2), 9.0, np.float32), messages.header(12.0, "camera"))

    def write(image):
        depths.write(late)
        depths.write(message)
        pictures.write(image)

    for writer in (depths, pictures):
        given(lambda of=writer: of.get_matched_subscriptions() or None, lambda _: None, None)
    frame = given(camera.newest, write, messages.Image(AT, 2, 2, "mono8", 0, 2, bytes(4)))
    np.testing.assert_array_equal(frame.depth, METRES)
    image = messages.Image(messages.header(13.0, "camera"), 2, 2, "mono8", 0, 2, bytes(4))
    assert given(camera.newest, pictures.write, image).depth is None  # it has none


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (
            messages.Image(AT, 2, 2, "mono8", 0, 2, bytes(4)),
            "/d: there is no encoding of depth 'mono8'; there is 32FC1, 16UC1",
        ),
        (
            messages.Image(AT, 2, 2, "32FC1", 0, 8, bytes(15)),
            "/d: a depth picture has too little data for its width 2 px, height 2 px and step "
            "8 bytes (strides is incompatible with shape of requested array and size of buffer): check "
            "its publisher",
        ),
    ],
)
def test_what_is_no_depth_picture_is_one_sentence(message, sentence):
    with pytest.raises(Mistake, match=f"^{re.escape(sentence)}$"):
        messages.depth_of(message, "/d")


def test_a_served_depth_camera_sends_its_depth_pictures():
    camera = Camera(depth="/camera/depth/image_raw")
    with servo.Episode(servo.load("depth_plate", ["run.duration=0.1"])) as episode:
        step = next(iter(episode))
        served = server.Server().serving(episode)
        frame = given(camera.newest, lambda _: served.publish(step), None)
    np.testing.assert_array_equal(frame.depth, step.frame.depth)
    np.testing.assert_array_equal(frame.image, step.frame.image)


@pytest.mark.parametrize("lens", [None, "plumb_bob", "rational", "fisheye"])
def test_a_calibration_survives_the_way(lens):
    count = {"plumb_bob": 5, "rational": 8, "fisheye": 4}
    distortion = None if lens is None else Distortion(lens, (0.01,) * count[lens])
    sent = dataclasses.replace(FISHEYE, distortion=distortion)
    camera = Camera(info=f"/{lens}/info")
    writer = Node().writer(f"/{lens}/info", messages.CameraInfo)
    given(lambda: writer.get_matched_subscriptions() or None, lambda _: None, None)
    writer.write(calibration(sent))
    assert camera.calibration() == sent


SHAPE = (
    "camera_matrix should be fx 0 cx, 0 fy cy, 0 0 1, without skew, with focal lengths above zero"
)
WRONG = [
    ({"k": [0.0] * 9}, SHAPE),
    ({"k": [np.nan] * 9}, "camera_matrix.0 = nan: input should be a finite number"),
    ({"d": [0.1] * 8, "distortion_model": "plumb_bob"}, "distortion_coefficients has 8 numbers, and the lens model plumb_bob has 5: correct the numbers or the model"),
    (
        {"d": [0.0] * 5, "distortion_model": "omni"},
        "distortion_model = 'omni' is no known lens model; there is plumb_bob, radtan, radial_tangential, "
        "rational_polynomial, rational, equidistant, fisheye, kannala_brandt, kannala_brandt4, "
        "kannala_brandt8 (leave it out if it names no lens)",
    ),
    (
        {"binning_x": 2},
        "binning_x = 2: input should be 0 or 1",
    ),
    (
        {"roi": messages.RegionOfInterest(40, 50, 200, 300, False)},
        "roi = {'x_offset': 40, 'y_offset': 50, 'height': 200, 'width': 300, 'do_rectify': 0} is "
        "not the whole picture; give the calibration of the whole picture",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("change", "sentence"), WRONG)
def test_a_message_of_no_calibration_is_one_sentence(change, sentence):
    with pytest.raises(Mistake) as refused:
        camera_of_info(dataclasses.replace(calibration(FISHEYE), **change), "/a/info")
    assert str(refused.value) == f"/a/info: {sentence}"


def test_a_fisheye_whose_coefficients_are_zeros_is_no_pinhole():
    equidistant = dataclasses.replace(FISHEYE, distortion=Distortion("fisheye", (0.0,) * 4))
    message = calibration(equidistant)
    for name in ("equidistant", "Equidistant"):
        message = dataclasses.replace(message, distortion_model=name)
        assert camera_of_info(message, "/a/info") == equidistant


def test_a_robot_knows_its_posture_from_joint_states_and_sends_twists():
    scenario = servo.load("arm7_line")
    with servo.Episode(scenario) as episode:
        expected = episode.world.posture()
        names = list(episode.world.robot.names)
    robot = Robot(scenario, "/b/joints", "/b/twist")
    writer = Node().writer("/b/joints", messages.JointState)
    given(lambda: writer.get_matched_subscriptions() or None, lambda _: None, None)
    backwards = ["gripper", *reversed(names)], [0.0, *reversed(expected.joints.tolist())]
    writer.write(messages.JointState(AT, *backwards, [], []))
    posture = robot.posture(12.25)
    np.testing.assert_allclose(posture.joints, expected.joints)
    np.testing.assert_allclose(
        posture.T_base_camera.translation, expected.T_base_camera.translation
    )
    np.testing.assert_allclose(posture.jacobian, expected.jacobian)
    np.testing.assert_array_equal(posture.twist, np.zeros(6))
    rate = 0.01
    moved = expected.joints + rate * np.eye(7)[2]
    writer.write(messages.JointState(messages.header(12.35, ""), names, moved.tolist(), [], []))
    time.sleep(0.2)
    twist = robot.posture(12.35).twist
    np.testing.assert_allclose(twist, expected.jacobian[:, 2] * rate / 0.1, atol=1e-3)
    reader = Node().reader("/b/twist", messages.TwistStamped)
    sent = given(lambda: (reader.take(1) or [None])[0], robot.go, np.arange(6.0))
    assert (sent.twist.linear.y, sent.twist.angular.z, sent.header.frame_id) == (1.0, 5.0, "camera")
    writer.write(
        messages.JointState(messages.header(12.5, ""), names[1:], moved.tolist()[1:], [], [])
    )
    time.sleep(0.2)
    with pytest.raises(Mistake, match=f"^/b/joints: there is no joint '{names[0]}'"):
        robot.posture(12.5)
    writer.write(messages.JointState(messages.header(12.7, ""), names, [], moved.tolist(), []))
    time.sleep(0.2)
    sentence = r"^/b/joints: a joint state has 7 names and 0 positions: send a position for each"
    with pytest.raises(Mistake, match=sentence):
        robot.posture(12.7)
    with pytest.raises(Mistake, match=r"^go: expected 6 finite numbers, got "):
        robot.go(np.full(6, np.nan))
    assert abs(robot.clock() - time.time()) < 1.0


def test_what_never_comes_is_one_sentence(monkeypatch):
    monkeypatch.setattr("servo.ros2.node.PATIENCE", 0.05)
    with pytest.raises(
        Mistake,
        match=r"^/c/info: no message has come within 0.05 s: start the program that publishes on this topic$",
    ):
        Camera(info="/c/info").calibration()


@pytest.mark.parametrize("domain", ["abc", "999", "9" * 30])
def test_a_domain_that_cannot_be_is_one_sentence(monkeypatch, domain):
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    monkeypatch.setenv("CYCLONEDDS_URI", "")
    sentence = f"ROS 2: CycloneDDS cannot start with ROS_DOMAIN_ID='{domain}' (0 to 232) and CYCLONEDDS_URI='': correct or unset them"
    with pytest.raises(Mistake, match=f"^{re.escape(sentence)}$"):
        Node()


@pytest.mark.parametrize("latency", ["latency_ms = 80", "latency = 2"])
@pytest.mark.parametrize("changes", [[], ["run.latency_ms=40"], ["run.latency=3"]])
def test_a_latency_is_not_used_where_twists_come_from_elsewhere(tmp_path, latency, changes):
    (tmp_path / "mine.toml").write_text(f"[run]\n{latency}")
    run = run_command.load(str(tmp_path / "mine.toml"), changes, None, server.Server()).run
    assert (run.latency, run.latency_ms) == (0, None)


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (
            messages.stamped(np.ones(6), messages.header(0.0, "base_link")),
            "a twist in the frame 'base_link' is refused: it has to be in the camera's optical "
            "frame 'camera' (header.frame_id)",
        ),
        (
            messages.stamped(np.full(6, np.nan), AT),
            "a twist with a number that is not finite is refused: send six finite numbers",
        ),
    ],
)
def test_a_twist_without_a_meaning_is_not_driven_and_said_once(capsys, message, sentence):
    served = server.Server()
    writer = Node().writer(server.TOPIC, messages.TwistStamped)

    def said():
        assert not served.command(None, None, 0.0).twist.any()
        return capsys.readouterr().err or None

    assert given(said, writer.write, message) == f"{server.TOPIC}: {sentence}\n"
    writer.write(message)
    time.sleep(0.1)
    assert said() is None
    unnamed = messages.stamped(np.ones(6), messages.header(0.0, ""))
    given(lambda: served.command(None, None, 0.0).twist.any() or None, writer.write, unnamed)
    assert served.command(None, None, 0.0).twist.all()


def test_a_served_robot_takes_the_newest_twist_and_stops_without_one(monkeypatch):
    served = server.Server()
    writer = Node().writer(server.TOPIC, messages.TwistStamped)

    def asked():
        twist = served.command(None, None, 0.0).twist
        return twist if twist.any() else None

    assert asked() is None
    np.testing.assert_array_equal(
        given(asked, writer.write, messages.stamped(np.arange(6.0), AT)), np.arange(6.0)
    )
    now = time.monotonic()
    monkeypatch.setattr(server.time, "monotonic", lambda: now + 0.4)
    assert asked() is None
    writer.write(messages.stamped(np.full(6, np.nan), AT))
    time.sleep(0.2)
    assert asked() is None


def test_a_sender_that_leaves_sends_no_twist():
    served = server.Server()
    writer = Node().writer(server.TOPIC, messages.TwistStamped)
    message = messages.stamped(np.arange(6.0), AT)
    given(lambda: served.command(None, None, 0.0).twist.any() or None, writer.write, message)
    writer.dispose(message)  # readers get a sample without data
    for _ in range(20):
        assert served.command(None, None, 0.0).twist.shape == (6,)
        time.sleep(0.01)


def test_joint_states_of_a_publisher_that_leaves_are_used_for_a_short_time(monkeypatch):
    monkeypatch.setattr("servo.ros2.node.PATIENCE", 0.05)
    scenario = servo.load("pan_tilt_line", ["tracker.kind=truth"])
    robot = Robot(scenario, "/e/joints", "/e/twist")
    first, second = (Node().writer("/e/joints", messages.JointState) for _ in range(2))
    for writer in (first, second):
        given(lambda of=writer: of.get_matched_subscriptions() or None, lambda _: None, None)

    def state(time, *joints):
        return messages.JointState(messages.header(time, ""), ["pan", "tilt"], [*joints], [], [])

    first.dispose(state(1.0, 0.0, 0.0))  # readers get a sample without data, and nothing else
    time.sleep(0.2)
    with pytest.raises(Mistake, match=r"^/e/joints: no message has come within 0.05 s: start the "):
        robot.posture(1.0)
    first.write(state(1.0, 0.1, 0.2))
    first.dispose(state(1.0, 0.1, 0.2))
    time.sleep(0.2)
    assert robot.posture(1.0).joints.tolist() == [0.1, 0.2]
    second.write(state(1.5, 0.3, 0.4))
    time.sleep(0.2)
    assert robot.posture(1.5).joints.tolist() == [0.3, 0.4]
    monkeypatch.setattr("servo.ros2.client.SILENT", 0.0)
    sentence = "/e/joints: no new joint state has come for 0 s: is the program that publishes on this topic still running?"
    with pytest.raises(Mistake, match=f"^{re.escape(sentence)}$"):
        robot.posture(1.5)
    second.write(state(1.4, 0.3, 0.4))  # the publisher's clock was set back: it is no less there
    time.sleep(0.2)
    assert robot.posture(1.5).joints.tolist() == [0.3, 0.4]


def test_the_joint_state_nearest_to_a_picture_is_found_among_those_of_1_khz():
    robot = Robot(servo.load("pan_tilt_line", ["tracker.kind=truth"]), "/f/joints", "/f/twist")
    writer = Node().writer("/f/joints", messages.JointState)
    given(lambda: writer.get_matched_subscriptions() or None, lambda _: None, None)

    def send(begin, count, pan):
        for k in range(count):
            stamp = messages.header(begin + k / 1000, "")
            writer.write(messages.JointState(stamp, ["pan", "tilt"], [pan + k / 1e4, 0.0], [], []))
        time.sleep(0.3)

    send(10.0, 400, 0.0)
    assert robot.posture(10.1).joints[0] == pytest.approx(0.01, abs=1e-9)
    send(
        5.0, 400, 0.1
    )  # the robot's clock was set back: the states of its earlier times are no more
    assert robot.posture(10.1).joints[0] == pytest.approx(0.1399, abs=1e-9)


CONTROLLER = """
import sys
import time
import servo
from servo.ros2 import Camera, Robot

name, depth, until = sys.argv[1:]
scenario = servo.load(name, ["controller.fastest=0.5"])
with servo.Episode(scenario) as episode:
    _, region, given = episode.shown
    outline = scenario.believed.outline(episode.world.outline)
camera = Camera(depth=depth or None)
robot = Robot(scenario)
loop = servo.Loop(scenario, camera.calibration(), outline)
heard = time.monotonic()
while (frame := camera.newest()) is None:
    if time.monotonic() > heard + 60.0:
        sys.exit("no picture has come")

for k in range(2):  # compile before the robot moves
    first = servo.Frame(frame.image, 0.0, 0, depth=frame.depth)
    loop.start(frame, region, given).step(first, robot.posture(frame.time))
running = loop.start(frame, region, given)
last = -1.0
heard = time.monotonic()
# On a busy machine the run may end before its last pictures are seen: then no more come.
while last < float(until) and time.monotonic() < heard + 5.0:
    if frame is not None and frame.time > last:
        robot.go(running.step(frame, robot.posture(frame.time)).twist)
        last = frame.time
        heard = time.monotonic()
    time.sleep(0.001)  # leave the core to the other process
    frame = camera.newest()
print(f"last picture: {last:.2f}")
"""


@pytest.mark.processes
@pytest.mark.parametrize(
    ("name", "depth", "duration", "measure", "most"),
    [
        # 0.8 px; the clock does not wait for a busy machine
        ("circle", "", 3.0, "servo_rms_px", 3.0),
        # 1.5 mm; 150 without the depth picture, as the plate is believed 1.2 times too large
        ("depth_plate", "/camera/depth/image_raw", 4.0, "end_position_mm", 10.0),
    ],
)
def test_two_processes_close_the_loop(tmp_path, name, depth, duration, measure, most):
    out = tmp_path / "served"
    words = ["run", name, "--ros2", "--no-rerun", "--out", str(out), "--quiet"]
    changes = ["--set", f"run.duration={duration}", "--set", "expect={}"]
    (tmp_path / "controller.py").write_text(CONTROLLER)
    served = Command([*words, *changes])
    controller = [tmp_path / "controller.py", name, depth, str(duration - 0.1)]
    try:
        code, said, mistakes = ran(controller, program=SCRIPT)
        assert (code, mistakes) == (0, "")
        assert float(said.removeprefix("last picture: ")) > 0.8 * duration, said
        assert served.communicate() == ("", "waiting for a twist on /servo/twist\n")
    finally:
        served.kill()
    assert served.returncode == 0
    measures = json.loads((out / "report.json").read_text())["measures"]
    assert 0.0 < measures[measure] < most


def test_the_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(
        Mistake, match=r"^ROS 2 needs the extra 'ros2': pip install 'servobench\[ros2\]'$"
    ):
        importlib.reload(sys.modules["servo.ros2"])


@pytest.mark.parametrize("missing", ["cyclonedds", "rosbags"])
def test_without_one_of_its_packages_the_extra_is_named(monkeypatch, missing):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == missing else name)
    with pytest.raises(Mistake) as told:
        importlib.reload(servo.ros2)
    assert str(told.value) == "ROS 2 needs the extra 'ros2': pip install 'servobench[ros2]'"
