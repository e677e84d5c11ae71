"""The flange of arms with grippers, tools and hands: what fingers and jaws move is not part of it."""

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner

from servo.cli.main import app
from servo.cli.robot_command import ASIDE, FEW
from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.kinematics.chain import flanges
from sim.kinematics.model import camera_chain
from sim.robots import mjcf


def body(name, joint="", inside="", kind="hinge"):
    """A body whose joint, if it has one, is a hinge or a slide."""
    moved = f'<joint name="{joint}" type="{kind}"/>' if joint else ""
    return f'<body name="{name}" pos="0 0 .1">{moved}<geom size=".01"/>{inside}</body>'


def arm(joints, hand, last="j0", link="l0"):
    """Joints one after another and what is on the last link, whose name and joint may be given."""
    found = body(link, last, hand)
    for k in range(1, joints):
        found = body(f"l{k}", f"j{k}", found)
    return found


def finger(side, phalanges=1):
    inside = ""
    for k in range(phalanges):
        inside = body(f"{side}{k}", f"{side}{k}", inside)
    return inside


TWO = finger("a") + finger("b")
FLANGES = {
    "a jaw that its name shows": (arm(5, body("x", "gripper")), "l0", 5),
    "a jaw of a hand that is named so too": (
        arm(5, body("Moving_Jaw", "Jaw"), "Wrist_Roll", "Fixed_Jaw"),
        "Fixed_Jaw",
        5,
    ),
    "numbered joints": (arm(5, body("moving_jaw", "6"), "5", "gripper"), "gripper", 5),
    "a jaw beside a tool's frame": (arm(5, body("tool_frame") + body("x", "y")), "tool_frame", 5),
    "a jaw beside a site": (arm(6, '<site name="grasp"/>' + body("x", "y")), "grasp", 6),
    "a frame before the last joint": (
        arm(5, body("tool_guide") + body("l6", "j6", body("flange"))),
        "flange",
        6,
    ),
    "tips of all links": (
        arm(5, body("l5_tip") + body("l6", "j6", '<site name="l6_tip"/>')),
        "l6_tip",
        6,
    ),
    "a tool that turns": (arm(5, body("tool", "j6")), "tool", 6),
    "a jaw on a fixed part": (arm(6, body("stator", "", body("mover", "motor"))), "stator", 6),
    "a slide beyond six hinges": (arm(6, body("link7", "joint7", kind="slide")), "l0", 6),
    "a slide beyond five hinges": (arm(5, body("link6", "joint6", kind="slide")), "l0", 5),
    "a slide beyond a rail and five hinges": (
        body("rail", "x", arm(5, body("link7", "joint7", kind="slide")), kind="slide"),
        "l0",
        6,
    ),
    "the quill of a SCARA": (arm(3, body("quill", "z", kind="slide")), "quill", 4),
    "two slides with neutral names": (
        arm(5, body("a", "joint6", kind="slide") + body("b", "joint7", kind="slide"), link="wrist"),
        "wrist",
        5,
    ),
    "two fingers, six joints": (arm(6, TWO), "l0", 6),
    "two fingers, four joints": (arm(4, TWO), "l0", 4),
    "two fingers and a frame": (arm(5, body("palm", "", TWO + body("hand_tcp"))), "hand_tcp", 5),
    "three fingers of three": (arm(6, "".join(finger(s, 3) for s in "abc")), "l0", 6),
    "one finger of two": (arm(6, body("p", "finger_1", body("d", "finger_2"))), "l0", 6),
    "a suction cup": (arm(6, body("cup", "", body("tcp"))), "tcp", 6),
    "frames of a UR": (arm(6, body("ee_link") + body("tool0") + body("box")), "tool0", 6),
    "a gripper that only turns": (arm(5, "", "gripper_roll", "gripper"), "gripper", 5),
    "nothing": (arm(7, ""), "l0", 7),
    "a finger alone": (body("finger_a", "finger_a", body("finger_b", "finger_b")), "finger_b", 2),
    "two arms on a turning column": (
        body("column", "turn", finger("left", 4) + finger("right", 4)),
        "left0",
        5,
    ),
}
SHOWN_OTHERWISE = (
    "a jaw beside a tool's frame",
    "a jaw beside a site",
    "a slide beyond six hinges",
    "a slide beyond five hinges",
    "a slide beyond a rail and five hinges",
)


@pytest.mark.parametrize("case", FLANGES)
def test_the_flange_is_the_hand_or_its_tool(case):
    text, flange, joints = FLANGES[case]
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    _, chain = camera_chain(spec, "", "")
    assert (chain.flange, len(chain.joints)) == (flange, joints)
    found = {name: count for _, name, count in flanges(spec)}
    # A jaw whose name says nothing may be a link of the arm.
    assert found[flange] == joints == max(found.values()) - (case in SHOWN_OTHERWISE)


LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link><joint name="j_{0}" type="revolute"><parent link="{1}"/>'
    '<child link="{0}"/><origin xyz="0 0 {2}"/><axis xyz="{3}"/>'
    '<limit lower="-2.5" upper="2.5" effort="50" velocity="3"/></joint>'
)
LINKS = (
    ("pan", "base", 0, "0 0 1"),
    ("lift", "pan", 0.3, "0 1 0"),
    ("elbow", "lift", 0.4, "0 1 0"),
    ("wrist", "elbow", 0.3, "0 1 0"),
    ("palm", "wrist", 0.06, "0 0 1"),
    ("jaw", "palm", 0.06, "0 1 0"),
)
FRAME = (
    '<link name="tool_frame"/><joint name="tool" type="fixed"><parent link="palm"/>'
    '<child link="tool_frame"/><origin xyz="0 0 0.1"/></joint>'
)


@pytest.mark.wide
def test_the_table_of_an_arm_with_one_jaw_runs_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    links = "".join(LINK.format(*link) for link in LINKS)
    (tmp_path / "one.urdf").write_text(f'<robot name="r"><link name="base"/>{links}{FRAME}</robot>')
    done = CliRunner().invoke(app, ["robot", "one.urdf"])
    rows = {line.split()[0]: line.split() for line in done.output.splitlines() if line.split()}
    assert rows["j_jaw"][-2:] == ["held", "still"]
    assert rows["palm"] == ["palm", "body", "5"]
    assert rows["tool_frame"] == ["tool_frame", "body", "(taken)", "5"]
    assert "jaw" not in rows
    assert FEW in done.output
    assert ASIDE not in done.output
    table = done.output[done.output.index("[robot]") : done.output.index("robot.png")]
    (tmp_path / "mine.toml").write_text(
        f'{table}\n[run]\nduration = 0.2\n[tracker]\nkind = "truth"\n'
    )
    with Episode(load("mine.toml")) as episode:
        assert len(list(episode)) == 6


def test_a_jaw_may_carry_the_camera_where_it_is_asked_for(tmp_path):
    links = "".join(LINK.format(*link) for link in LINKS)
    path = tmp_path / "one.urdf"
    path.write_text(f'<robot name="r"><link name="base"/>{links}</robot>')
    design = mjcf.Config(model=str(path), flange="jaw").build(np.random.default_rng(0))
    assert [joint.name for joint in design.spec.joints] == [f"j_{link[0]}" for link in LINKS]
