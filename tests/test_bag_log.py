"""A bag of ROS as a robot's log: which topics are read, and into which columns."""

from pathlib import Path

import numpy as np
import pytest

from servo.mistake import Mistake
from servo.twin.readings import log_table

bags = pytest.importorskip("bags", reason="rosbags and mcap are not installed")
STAMPS = [0.0, 0.5, 1.0]
FORMS = ["log.mcap", "log.bag", "log_db3"]


def made(store, name, **fields):
    return store.types[f"geometry_msgs/msg/{name}"](**fields)


def vector(store, values):
    return made(store, "Vector3", **dict(zip("xyz", values, strict=True)))


def twist(store, values):
    return made(store, "Twist", linear=vector(store, values[:3]), angular=vector(store, values[3:]))


def rows(kind, message):
    """Messages that were recorded 0.2 s after their stamps."""

    def make(store):
        for k, stamp in enumerate(STAMPS):
            time = bags.START + stamp
            yield time + 0.2, kind, message(store, bags.header(store, time), float(k))

    return lambda store: list(make(store))


def pose(store, header, k):
    place = made(store, "Point", x=k, y=2.0, z=3.0)
    turn = made(store, "Quaternion", x=0.0, y=0.6, z=0.0, w=0.8)
    whole = made(store, "Pose", position=place, orientation=turn)
    return made(store, "PoseStamped", header=header, pose=whole)


def stamped(store, header, k):
    return made(store, "TwistStamped", header=header, twist=twist(store, [k, 2, 3, 4, 5, 6]))


def joints(store, header, k):
    kind = store.types["sensor_msgs/msg/JointState"]
    empty = np.zeros(0)
    return kind(header, ["yaw", "x"], np.array([k, 0.5]), empty, empty)


POSES = rows("geometry_msgs/msg/PoseStamped", pose)
TWISTS = rows("geometry_msgs/msg/TwistStamped", stamped)
JOINTS = rows("sensor_msgs/msg/JointState", joints)
BARE = rows("geometry_msgs/msg/Twist", lambda store, _, k: twist(store, [k, 2, 3, 4, 5, 6]))


@pytest.mark.parametrize("form", FORMS)
def test_poses_and_commands_are_rows_by_their_stamps(tmp_path, form):
    path = bags.write(tmp_path / form, {"/hand": POSES, "/go": BARE, "/joint_states": JOINTS})
    table = log_table(path, None, None, None).to_pydict()
    times = [at - bags.START for at in table["time_s"]]
    assert times == pytest.approx([0, 0.2, 0.5, 0.7, 1.0, 1.2], abs=1e-6)
    assert table["hand_x_m"] == [0, None, 1, None, 2, None]
    assert table["hand_qw"][::2] == [0.8] * 3
    assert table["command_vx_m_s"] == [None, 0, None, 1, None, 2]
    assert table["command_wz_rad_s"][1::2] == [6] * 3
    assert len(table) == 14


def test_joints_have_the_units_of_the_scenario_s_robot(tmp_path):
    path = bags.write(tmp_path / "log.mcap", {"/hand": POSES, "/joint_states": JOINTS})
    table = log_table(path, "line", None, None).to_pydict()
    assert table.keys() == {"time_s", "joint_yaw_rad", "joint_x_m"}
    assert table["joint_yaw_rad"] == [0, 1, 2]


def test_the_only_twists_are_measured_ones(tmp_path):
    path = bags.write(tmp_path / "log.mcap", {"/speed": TWISTS})
    table = log_table(path, None, None, None).to_pydict()
    assert table["measured_vx_m_s"] == [0, 1, 2]
    assert len(table) == 7


def test_topics_are_chosen_by_name(tmp_path):
    topics = {"/one": POSES, "/other": POSES, "/go": TWISTS, "/asked": TWISTS}
    path = bags.write(tmp_path / "log.mcap", topics)
    pose, twist = "geometry_msgs/PoseStamped", "geometry_msgs/TwistStamped"
    for motion, commands, sentence in (
        (
            None,
            None,
            f"there are several topics with the hand's motion: /one (3 of {pose}), /other (3 of "
            f"{pose}); choose one with --motion",
        ),
        (
            "/one",
            None,
            f"there are several topics with commanded twists: /go (3 of {twist}), /asked (3 of "
            f"{twist}); choose one with --commands",
        ),
        (
            "/up",
            None,
            f"this bag has no topic '/up' with the hand's motion; it has /one (3 of {pose}), "
            f"/other (3 of {pose}), /go (3 of {twist}), /asked (3 of {twist})",
        ),
    ):
        with pytest.raises(Mistake) as refused:
            log_table(path, None, motion, commands)
        assert str(refused.value) == f"{path}: {sentence}"
    table = log_table(path, None, "/go", "/asked").to_pydict()
    assert table["measured_vx_m_s"] == table["command_vx_m_s"] == [0, 1, 2]


def test_a_bag_without_motion_says_what_to_record(tmp_path):
    path = bags.write(tmp_path / "log.mcap", {"/words": lambda s: [(1.0, bags.TEXT, bags.text(s))]})
    with pytest.raises(Mistake) as refused:
        log_table(path, None, None, None)
    assert str(refused.value) == (
        f"{path}: this bag has no topic with the hand's motion: sensor_msgs/JointState, "
        "geometry_msgs/PoseStamped or geometry_msgs/TwistStamped; record one of them, or give a "
        "log beside the bag"
    )
    with pytest.raises(Mistake, match="--motion and --commands are topics of a bag"):
        log_table(Path("log.csv"), None, "/hand", None)
