"""Robots that cannot be are refused in a sentence; a command shows what is there."""

import json
import re
import tomllib

import numpy as np
import pytest
from click.testing import CliRunner
from measured import measured_run
from robot_files import built, mjcf_arm, tall_arm, urdf_arm

from servo.cli.main import app
from servo.cli.robot_command import ASIDE, FEW, NO_BASE
from servo.cli.run_command import remarks
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.output.room_view import RoomView
from servo.scenario.load import load
from sim.camera.renderer import Unseen
from sim.kinematics.doubts import doubts
from sim.robots import mjcf


@pytest.fixture
def urdf(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_arm())
    return tmp_path / "arm.urdf"


@pytest.fixture
def seven(tmp_path):
    (tmp_path / "arm.xml").write_text(mjcf_arm(tmp_path))
    return tmp_path / "arm.xml"


@pytest.mark.wide
@pytest.mark.parametrize("base", ["[0, 3, 0.6, -90]", "[0, 0.5, -2, -90]"])
def test_a_base_that_is_too_far_away_is_a_sentence(seven, base):
    changes = ["robot.kind=mjcf", f"robot.model={seven}", f"robot.base={base}"]
    with pytest.raises(Mistake) as refused:
        Episode(load("still", changes))
    start = "still: start: the robot cannot bring the camera to its start pose: "
    sentence = (
        r"\d\.\d\d m and \d+ deg are left, and (joint 'joint\d' is at its "
        r"limit|no joint is at a limit; 'joint\d' is nearest to one)"
    )
    hint = (
        "; change [start] or [goal], or try another robot.base, or a robot.home near a posture "
        "that gets there"
    )
    assert re.fullmatch(re.escape(start) + sentence + re.escape(hint), str(refused.value))


def test_a_start_that_a_seed_drew_is_named_by_it(seven):
    changes = ["robot.kind=mjcf", f"robot.model={seven}", "robot.base=[0, 3, 0.6, -90]"]
    with pytest.raises(Mistake, match=r"^still: start, seed 7: the robot cannot bring the camera "):
        Episode(load("still", changes, seed=7))


WRONG = {
    'flange = "wrist_9_link"': (
        "there is no body or site 'wrist_9_link' for the flange; did you mean 'wrist_3_link'?"
    ),
    'flange = "zz"': "there is no body or site 'zz' for the flange; there is wrist_3_link, tool",
    'camera = "eye"': "there is no camera 'eye' in the model; it has none",
    'camera = "eye"\nflange = "tool"': "camera is given together with flange or mount: give either "
    "camera, or flange and mount",
    "home = [[0, 0, 0, 0, 0, 0, 0]]": (
        "home has 7 joint positions; it should have 6, for pan, lift, elbow, wrist_1, wrist_2, wrist_3"
    ),
    "home = [[0, 0, 0, 0, 0, 0], [0, -90, 90, 0, 0, 0]]": (
        "home has the joint lift at -90, outside of its limits -6.28 .. 6.28: correct home"
    ),
    "speed = [1.0, 2.0]": (
        "speed has 2 values; it should have one for all joints, or 6 for pan, lift, elbow, wrist_1, wrist_2, "
        "wrist_3"
    ),
}


@pytest.mark.parametrize("lines", WRONG)
def test_a_setting_that_does_not_fit_the_model_is_a_sentence(tmp_path, urdf, lines):
    (tmp_path / "mine.toml").write_text(f'[robot]\nkind = "mjcf"\nmodel = "arm.urdf"\n{lines}\n')
    with pytest.raises(Mistake) as refused:
        Episode(load(str(tmp_path / "mine.toml")))
    assert str(refused.value) == f"mine: robot: arm.urdf: {WRONG[lines]}"


def test_a_limit_that_is_no_number_names_its_joint(tmp_path, urdf):
    limits = re.search(r'<limit[^>]*velocity="[^"]*"', urdf_arm())[0]
    for key in ("lower", "velocity"):
        odd = re.sub(rf'{key}="[^"]*"', f'{key}="fast"', limits)
        urdf.write_text(urdf_arm().replace(limits, odd, 1))
        with pytest.raises(
            Mistake, match=rf"the joint 'pan' has {key} = 'fast': expected a number$"
        ):
            Episode(load("still", ["robot.kind=mjcf", f"robot.model={urdf}"]))


UNFIT = {
    "<freejoint/>": "the body 'link1' has a free joint: remove the joint or the body",
    '<joint name="ball" type="ball"/>': (
        "the joint 'ball' between base and flange is a ball joint: replace it by hinges"
    ),
}


@pytest.mark.parametrize("joint", UNFIT)
def test_a_robot_that_is_no_chain_of_hinges_and_slides_is_a_sentence(seven, joint):
    seven.write_text(
        re.sub('<joint name="joint1"[^>]*>', joint, seven.read_text())
        .replace('<position name="a1" joint="joint1" kp="2000" kv="200" forcerange="-87 87"/>', "")
        .replace("<key ", "<!-- ")
        .replace('.04 .04"/>', "-->")
    )
    with pytest.raises(ValueError, match=re.escape(f"arm.xml: {UNFIT[joint]}")):
        mjcf.Config(model=str(seven)).build(np.random.default_rng(0))


@pytest.mark.parametrize(
    ("constraint", "name"),
    [
        (
            '<connect name="bar" body1="link2" body2="link4" anchor="0 0 0"/>',
            "connection 'bar' of 'link2' and 'link4'",
        ),
        ('<weld body1="link7" anchor="0 0 0"/>', "weld of 'link7'"),
        (
            '<joint name="coupled" joint1="joint3" joint2="joint5"/>',
            "coupling (mimic) 'coupled' of 'joint3' and 'joint5'",
        ),
        ('<joint joint1="joint3"/>', "coupling (mimic) of 'joint3'"),
        ('<tendon tendon1="arm"/>', "coupling of 'arm'"),
    ],
)
def test_a_closed_loop_is_a_sentence(seven, constraint, name):
    arm = '<fixed name="arm"><joint joint="joint2" coef="1"/></fixed></tendon>'
    text = seven.read_text().replace("</equality>", f"{constraint}</equality>")
    seven.write_text(text.replace("</tendon>", arm))
    with pytest.raises(ValueError, match=re.escape(f"arm.xml: the {name} closes a loop or couple")):
        mjcf.Config(model=str(seven)).build(np.random.default_rng(0))


def test_a_model_without_joints_or_with_few_is_a_sentence(tmp_path):
    (tmp_path / "box.xml").write_text('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
    with pytest.raises(ValueError, match=re.escape("box.xml: the model has no joints: a robot")):
        mjcf.Config(model=str(tmp_path / "box.xml")).build(np.random.default_rng(0))


def test_lengths_in_mm_and_limits_in_degrees_are_doubted(urdf):
    assert doubts(built(model=str(urdf))[0]) == []
    wrong = urdf_arm().replace("0 -0.12 0.42", "0 -120 420")
    urdf.write_text(wrong.replace("6.28", "180", 2))
    assert doubts(built(model=str(urdf))[0]) == [
        "The robot's links are 438 m long together: are the model's lengths in mm?",
        "Joints that turn by up to 360 rad: pan. Are the model's limits in degrees?",
    ]


def test_a_start_is_doubted_whose_target_the_robot_hides_and_whose_joints_turn_too_far(tmp_path):
    shut = '<geom type="box" size=".2 .2 .01" pos="0 0 .1"/><site name="tool"/>'
    text = tall_arm().replace('<site name="tool"/>', shut)
    (tmp_path / "arm.xml").write_text(text.replace("-3.1 3.1", "-180 180"))
    robot = [f"robot.model={tmp_path / 'arm.xml'}", "robot.base=[0.0, 0.54, 0.68, -90.0]"]
    changes = ["robot.kind=mjcf", *robot, "tracker.kind=truth"]
    with Episode(load("still", changes)) as episode:
        assert remarks(episode) == [
            "Joints that turn by up to 360 rad: j6. Are the model's limits in degrees?",
            "The target is hidden in the first picture: 0 % of it is visible",
        ]


def test_the_command_prints_a_table_that_runs(tmp_path, seven):
    out = tmp_path / "robot.png"
    slow = r'<velocity name="a2" joint="joint2" kv="50" ctrlrange="-.3 .4"/>'
    seven.write_text(re.sub('<position name="a2"[^>]*>', slow, seven.read_text()))
    done = CliRunner().invoke(app, ["robot", str(seven), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert re.search(
        r"joint1 +hinge +-2.9 .. 2.9 rad +2 rad/s +[0-9.]+ ms +position: replaced", done.output
    )
    assert re.search(r"joint2 .* rad +0.3 rad/s +[0-9.]+ ms +velocity: replaced", done.output)
    assert re.search(r"left +slide +0 .. 0.04 +held still", done.output)
    again = CliRunner().invoke(app, ["robot", str(seven), "--out", str(out)])
    assert str(again.exception) == f"{out}: this file exists already; choose another name"
    assert re.search(r"attachment +site \(taken\) +7", done.output)
    assert "From the base below the camera can be 1 m above the target." in done.output
    table = done.output[done.output.index("[robot]") : done.output.index(str(out))]
    assert json.dumps(str(seven)) in table
    (tmp_path / "mine.toml").write_text(f"{table}\n[run]\nduration = 0.1\n")
    with Episode(load(str(tmp_path / "mine.toml"))) as episode:
        assert len(list(episode)) == 3


def test_the_picture_takes_a_free_name_and_the_names_of_joints_are_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.png").write_text("mine")
    text = urdf_arm().replace("wrist_3_link", "the_last_link_of_all_its_links")
    (tmp_path / "arm.urdf").write_text(text.replace('"wrist_3"', '"the_last_joint_of_the_robot"'))
    done = CliRunner().invoke(app, ["robot", "arm.urdf"])
    assert done.output.endswith("\nrobot-2.png\n")
    assert (tmp_path / "robot.png").read_text() == "mine"
    row = (
        r"the_last_joint_of_the_robot +hinge +-6.28 .. 6.28 rad +3.15 rad/s +\d.* ms +none: one is"
    )
    assert re.search(row, done.output)
    assert re.search(r"the_last_link_of_all_its_links +body +6", done.output)


@pytest.mark.wide
@pytest.mark.parametrize(("robot", "height"), [("gantry", 1.55), ("scara", 1.25), ("arm7", 1.2)])
def test_the_picture_has_the_whole_robot_with_its_stand(robot, height, monkeypatch, tmp_path):
    fit, look, seen = RoomView.fit, RoomView.look, []

    def fitted(view, points):
        fit(view, points)
        seen.append((points, view.project(points)))

    def from_the_least_distance(view, eye, middle):
        look(view, middle + (eye - middle) / 1.1, middle)

    monkeypatch.setattr(RoomView, "fit", fitted)
    done = CliRunner().invoke(app, ["robot", robot, "--out", str(tmp_path / "a.png")])
    assert done.exit_code == 0, done.output
    monkeypatch.setattr(RoomView, "look", from_the_least_distance)
    again = CliRunner().invoke(app, ["robot", robot, "--out", str(tmp_path / "b.png")])
    assert again.exit_code == 0, again.output
    (points, pixels), (_, nearer) = seen
    assert points[:, 2].min() == pytest.approx(0.0, abs=0.1)  # columns begin on the table
    assert points[:, 2].max() > height
    assert (pixels > 0).all()
    assert (pixels < (640, 480)).all()
    assert np.abs(nearer / (640, 480) - 0.5).max() == pytest.approx(0.5)  # one is on the border


@pytest.mark.parametrize(
    ("model", "sentence"),
    [
        ("scara", "From the base below the camera can be 1 m above the target."),
        ("pan_tilt", "From the base below the camera sees the target, 0.95 m and 45 deg from the "),
    ],
)
def test_the_table_of_a_shipped_robot_of_few_joints_runs(tmp_path, model, sentence):
    done = CliRunner().invoke(app, ["robot", model, "--out", str(tmp_path / "a.png")])
    assert sentence in done.output
    said = f"{ASIDE}{FEW}" if model == "pan_tilt" else FEW
    assert said in done.output.splitlines()
    table = tomllib.loads(done.output[done.output.index("[robot]") :].partition("\n\n")[0])
    assert table["robot"]["camera"] == "eye"
    changes = [f"robot.{key}={value}" for key, value in table["robot"].items()]
    scenario = load("line", [*changes, "tracker.kind=truth", "run.duration=1.5"])
    steps, summary = measured_run(scenario)
    assert summary.outcome.name == "CONVERGED"
    assert steps[-1].servo_error < 1.0


def test_no_table_is_printed_for_a_robot_that_cannot_begin(tmp_path):
    up = ["scara", "--flange", "eye", "--out", str(tmp_path / "a.png")]
    done = CliRunner().invoke(app, ["robot", *up])
    assert "it never looks down: turn it with --mount." in done.output
    assert "1 m above the target: 0.99 m and 180 deg are left" in done.output
    assert NO_BASE in done.output
    assert "[robot]" not in done.output


def test_the_command_refuses_what_cannot_be_a_robot(urdf):
    done = CliRunner().invoke(app, ["robot", str(urdf), "--base", "1,2,x,4"])
    assert "is not 4 numbers with commas between them" in done.output


def test_a_flange_that_nothing_moves_is_refused(tmp_path):
    model = tmp_path / "fixed.xml"
    model.write_text(
        '<mujoco><worldbody><body name="stand"><geom size=".1"/></body><body><joint name="a"/>'
        '<geom size=".1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match=r"fixed.xml: no joint moves the flange 'stand'"):
        mjcf.Config(model=str(model), flange="stand").build(np.random.default_rng(0))


@pytest.mark.wide
def test_the_command_takes_a_flange_that_three_joints_move(urdf, tmp_path):
    picture = ["--out", str(tmp_path / "a.png")]
    done = CliRunner().invoke(app, ["robot", str(urdf), "--flange", "elbow_link", *picture])
    assert (
        "Its 3 joints can follow these components of the camera's twist there, each" in done.output
    )


def test_the_command_reports_a_camera_behind_the_robot(tmp_path, seven):
    behind = ["--flange", "link7", "--mount", "0,0,-0.1,0,0,0"]
    done = CliRunner().invoke(app, ["robot", str(seven), *behind, "--out", str(tmp_path / "a.png")])
    text = r"The robot itself fills (\d+) % of the picture: move the camera with --mount"
    # Both renderers give 81; the edges of another one may differ.
    assert abs(int(re.search(text, done.output)[1]) - 81) <= 1


def test_the_robot_in_its_cameras_picture_is_a_mask_over_all_geoms(tmp_path, monkeypatch):
    class Noting(Unseen):
        def silhouette(self, data, geoms, *, alone):
            masks.append(geoms)
            return super().silhouette(data, geoms, alone=alone)

    masks = []
    monkeypatch.setattr("servo.cli.robot_command.renderer_of", lambda camera: Noting)
    done = CliRunner().invoke(app, ["robot", "pan_tilt", "--out", str(tmp_path / "a.png")])
    assert done.exit_code == 0, done.output
    [mask] = masks
    assert mask.dtype == bool
    assert mask.sum() == 4  # mast, yoke, camera body and lens


@pytest.mark.parametrize("model", ["", "n" * 300, "a\0b", "no/such.xml", "."])
def test_a_model_that_no_file_can_be_is_a_sentence(model):
    with pytest.raises(
        ValueError, match=r"cannot read this robot model: |no file of this name is shipped"
    ):
        mjcf.Config(model=model).build(np.random.default_rng(0))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('xyz="0 0.09 0"', 'xyz="nan 0 0"', "the position of a body is not finite: correct it"),
        (
            'lower="-6.28" upper="6.28"',
            'lower="6.28" upper="-6.28"',
            "the lower limit 6.28 of the joint 'pan' is above its upper limit -6.28: correct them",
        ),
        ("<link", "<a>" * 20_000 + "</a>" * 20_000 + "<link", "maximum recursion depth exceeded"),
    ],
)
def test_a_urdf_of_no_numbers_or_too_deep_is_a_sentence(tmp_path, old, new, why):
    (tmp_path / "arm.urdf").write_text(urdf_arm().replace(old, new))
    with pytest.raises(ValueError, match=f"cannot read this robot model: .*{why}"):
        mjcf.Config(model=str(tmp_path / "arm.urdf")).build(np.random.default_rng(0))
