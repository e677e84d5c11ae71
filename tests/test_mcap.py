"""MCAP logs, read by another reader: what is in them, and when."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from tracked import REGION, call, image, pictures

import servo
from servo.cli.outputs import Outputs
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.output.mcap_file import McapFile, RunMcap
from servo.output.ros2_messages import Kind
from sim.models.quaternion import matrix_of
from sim.types import Pose

CHANGES = [
    "run.duration=0.2",
    "tracker.kind=condensation",
    "estimator.kind=none",
    "start.x=-40",
    "camera.distortion=plumb_bob",
    "camera.coefficients=[-0.1, 0.02, 0.0, 0.0, 0.0]",
]


def read(path):
    """Times [s] and messages by topic, as rosbags reads them."""
    found = {}
    with AnyReader([path]) as bag:
        for connection, time, raw in bag.messages():
            one = time / 1e9, bag.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append(one)
    return found


def pose(transform):
    t, q = transform.transform.translation, transform.transform.rotation
    return Pose(matrix_of([q.w, q.x, q.y, q.z]), np.array([t.x, t.y, t.z]))


def test_the_log_of_a_run_has_its_pictures_numbers_and_frames(tmp_path):
    path, steps = tmp_path / "a.mcap", []
    with Episode(servo.load("still", CHANGES)) as episode:
        log = RunMcap(path, episode)
        for step in episode:
            log.add(step)
            steps.append(step)
        log.close()
    found, times = read(path), [step.frame.time for step in steps]
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/camera/image/compressed": 6,
        "/camera/annotations": 6,
        "/estimate": 6,
        "/tf": 6,
        "/step": 6,
        "/camera/camera_info": 6,
    }
    assert [time for time, _ in found["/camera/image/compressed"]] == pytest.approx(times)
    jpeg = found["/camera/image/compressed"][0][1].data
    assert cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1).shape == (240, 320, 3)
    camera, last = steps[0].scene.camera, steps[-1]
    stamps = [
        [(m.header.stamp.sec, m.header.stamp.nanosec) for _, m in found[topic]]
        for topic in ("/camera/camera_info", "/camera/image/compressed")
    ]
    assert stamps[0] == stamps[1]
    assert len(set(stamps[0])) == 6
    _, calibration = found["/camera/camera_info"][-1]
    assert (calibration.distortion_model, list(calibration.d)) == (
        "plumb_bob",
        [-0.1, 0.02, 0.0, 0.0, 0.0],
    )
    assert list(calibration.k) == [camera.fx, 0, 159.5, 0, camera.fy, 119.5, 0, 0, 1]
    tree = {t.child_frame_id: (t.header.frame_id, pose(t)) for t in found["/tf"][-1][1].transforms}
    assert {child: parent for child, (parent, _) in tree.items()} == {
        "base": "world",
        "camera": "base",
        "target": "world",
    }
    eye = tree["base"][1] @ tree["camera"][1]
    np.testing.assert_allclose(eye.translation, last.truth.T_world_camera.translation, atol=1e-9)
    np.testing.assert_allclose(eye.rotation, last.truth.T_world_camera.rotation, atol=1e-9)
    target = (eye.inverse() @ tree["target"][1]).translation
    assert target[2] == pytest.approx(last.truth.depth)
    outlines = found["/camera/annotations"][-1][1].points
    assert len(outlines) == 4  # truth, goal, estimate, particles
    drawn = [(p.x, p.y) for p in outlines[1].points]
    np.testing.assert_allclose(drawn, last.goal.corners, atol=1e-9)
    row = found["/step"][-1][1]
    assert row.servo_error_px == pytest.approx(last.servo_error)
    assert row.status == last.estimate.status.name


def test_a_standing_camera_stands_where_the_robot_holds_the_target(tmp_path):
    path = tmp_path / "a.mcap"
    with Episode(servo.load("hand_plate", ["run.duration=0.3"])) as episode:
        log = RunMcap(path, episode)
        steps = [step for step in episode if log.add(step) is None]
        log.close()
    for (_, message), step in zip(read(path)["/tf"], steps, strict=True):
        (eye,) = (pose(t) for t in message.transforms if t.child_frame_id == "camera")
        true = step.truth.T_world_camera.translation
        np.testing.assert_allclose(eye.translation, true, atol=1e-9)


def test_the_log_of_a_track(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    pictures(tmp_path)
    arguments = ["in", "--region", REGION, "-q", "--tracker", "frozen", "--mcap", "a.mcap"]
    assert call(monkeypatch, capfd, *arguments)[0] == 0
    found = read(tmp_path / "a.mcap")
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/camera/image/compressed": 8,
        "/camera/annotations": 8,
        "/estimate": 8,
        "/shot": 8,
    }
    time, row = found["/shot"][3]
    assert time == pytest.approx(0.1)
    assert (row.frame, row.status, row.x, row.y) == (3, "UNSURE", 55.0, 40.0)
    jpeg = np.frombuffer(found["/camera/image/compressed"][3][1].data, np.uint8)
    assert np.abs(cv2.imdecode(jpeg, 1).astype(int) - image(3)).mean() < 5
    ((_, shot), *_) = found["/camera/annotations"]
    first = shot.points[0].points[0]
    assert (first.x, first.y) == (40.0, 30.0)
    time, estimate = found["/estimate"][3]
    stamp = estimate.header.stamp
    assert stamp.sec + stamp.nanosec / 1e9 == time
    corners = [(p.x, p.y) for p in estimate.polygon.points]
    assert corners == [(40.0, 30.0), (70.0, 30.0), (70.0, 50.0), (40.0, 50.0)]


def test_definitions_name_the_time_of_ros_2():
    """ROS 1's type `time` is not parsed by mcap-ros2-support."""
    for kind in (
        "sensor_msgs/CompressedImage",
        "foxglove_msgs/ImageAnnotations",
        "tf2_msgs/TFMessage",
    ):
        fields = [line.split()[0] for line in Kind(kind).definition.decode().splitlines() if line]
        assert "builtin_interfaces/Time" in fields
        assert "time" not in fields


def test_names_that_are_alike_as_fields_stay_apart(tmp_path):
    # ROS 2 has fields in small letters only.
    columns = ["joint_A-b_rad", "joint_a_b_rad", "joint_左_rad", "joint_右_rad", "time_s"]
    file = McapFile(tmp_path / "a.mcap", "/step", dict.fromkeys(columns, "float64"))
    file.row(0, {column: number for number, column in enumerate(columns)})
    file.close()
    ((_, row),) = read(tmp_path / "a.mcap")["/step"]
    assert {name: value for name, value in vars(row).items() if name != "__msgtype__"} == {
        "joint_a_b_rad": 0.0,
        "joint_a_b_rad_1": 1.0,
        "joint_rad": 2.0,
        "joint_rad_3": 3.0,
        "time_s": 4.0,
    }


def test_without_the_package_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(Mistake) as refused:
        Outputs(mcap=tmp_path / "a.mcap").check()
    assert str(refused.value) == (
        "--mcap needs the packages foxglove-sdk and rosbags: install servobench[mcap]"
    )
    assert list(tmp_path.iterdir()) == []


def test_the_first_error_of_the_disk_is_kept():
    file = McapFile(Path("/dev/full"), "/step", {"a": "float64"})
    for write in (lambda: file.row(0, {"a": 1.0}), file.close):
        with pytest.raises(OSError, match="No space left"):
            write()
