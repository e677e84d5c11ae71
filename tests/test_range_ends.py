"""Joints at the ends of their ranges leave the solution, and the others go on."""

import mujoco
import numpy as np
import pytest
from measured import measured_run
from robot_files import urdf_arm

from servo.cli.run_command import remarks
from servo.loop.episode import Episode
from servo.loop.run_measures import Outcome
from servo.scenario.load import load
from sim.camera.camera import CameraConfig
from sim.kinematics.inverse_kinematics import reach
from sim.kinematics.robot import Robot
from sim.models.assembly import build_model
from sim.robots import arm, gantry, head
from sim.targets import car

HEAD = """
<mujoco>
  <worldbody>
    <body name="lift" pos="0 0 {height}">
      <joint name="lift" type="slide" axis="0 0 1" range="0 {way}"/>
      <geom type="box" size="0.06 0.06 0.15" mass="5"/>
      <body name="pan" pos="0 0 0.35">
        <joint name="pan" axis="0 0 1" range="-70 {pan}"/>
        <geom type="cylinder" size="0.05 0.03" mass="1"/>
        <body name="tilt" pos="0.03 0 0.08">
          <joint name="tilt" axis="0 1 0" range="-30 80"/>
          <geom type="box" size="0.03 0.08 0.03" mass="1"/>
          <camera name="eye" pos="0.04 0 0" xyaxes="0 -1 0 0 0 1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def head_run(folder, *changes, height=0.6, way=0.3, pan=70):
    """A pan-tilt head on a lift, beside the table, which looks at the car."""
    model = folder / "head.xml"
    model.write_text(HEAD.format(height=height, way=way, pan=pan))
    text = (
        '[run]\nduration = 3.0\n[robot]\nkind = "mjcf"\nmodel = "head.xml"\n'
        'base = [0.0, -1.0, 0.0, 90.0]\ncamera = "eye"\n[start]\nx = 25.0\n'
    )
    scenario = folder / "head.toml"
    scenario.write_text(text)
    return measured_run(load(scenario, ["tracker.kind=truth", *changes]))


@pytest.mark.parametrize("law", ["ibvs", "qp"])
@pytest.mark.parametrize(
    ("changes", "model", "end"),
    [
        ([], {}, 0.01),
        (["goal.depth=3.0"], {}, 0.3),
        ([], {"way": 1e-6}, 0.0),
        (["believed.joint_offsets=[0.005, 0.0, 0.0]"], {}, 0.005),
    ],
    ids=["lower", "upper", "locked", "believed"],
)
def test_a_head_on_a_lift_at_its_end_centres_the_target(tmp_path, law, changes, model, end):
    steps, summary = head_run(tmp_path, *changes, f"controller.kind={law}", **model)
    assert steps[-1].servo_error < 2.0
    assert max(s.servo_error for s in steps) < 26.0
    assert steps[-1].joints[0] == pytest.approx(end, abs=2e-3)
    assert (summary.outcome, summary.limits) == (Outcome.LIMIT_HIT, ("lift (range)",))
    assert steps[-1].command.limits == ("joint 1",)


def test_of_two_joints_at_their_ends_the_third_goes_on(tmp_path):
    """The target drives beyond what pan can see: tilt still keeps its height in the picture."""
    line = ["motion.kind=line", "motion.x=0.1", "motion.speed=-0.2", "start={}"]
    steps, summary = head_run(tmp_path, *line, pan=8)
    assert set(summary.limits) == {"lift (range)", "pan (range)"}
    across, down = steps[-1].truth.centre - steps[-1].goal.centre
    assert abs(across) > 40.0
    assert abs(down) < 8.0


def placed(kind, q):
    design = kind.Config().build(np.random.default_rng(0))
    target = car.Config().build(np.random.default_rng(0))
    model = build_model(480.0, CameraConfig(), design, target)
    robot, data = Robot(model, design), mujoco.MjData(model)
    data.qpos[robot.qpos] = q
    robot.refresh(data)
    return robot, data


def test_a_gantry_at_the_end_of_its_rail_loses_this_direction_only():
    robot, data = placed(gantry, [1.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    asked = robot.jacobian(data) @ [0.1, 0.05, -0.02, 0.1, 0.0, 0.0]
    rates, made, names = robot.rates(data, asked)
    np.testing.assert_allclose(rates, [0.0, 0.05, -0.02, 0.1, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(made, robot.jacobian(data) @ rates, atol=1e-12)
    assert names == ("x (range)",)
    _, _, back = robot.rates(data, -asked)
    assert back == ()


def test_a_head_whose_joints_are_all_at_their_ends_stands():
    robot, data = placed(head, np.radians([85.0, 85.0]))
    asked = robot.jacobian(data) @ [0.2, 0.1]
    rates, made, names = robot.rates(data, asked)
    np.testing.assert_array_equal(rates, [0.0, 0.0])
    np.testing.assert_array_equal(made, np.zeros(6))
    assert names == ("pan (range)", "tilt (range)")


def test_an_arm_with_a_joint_at_its_end_makes_the_nearest_twist():
    robot, data = placed(arm, [np.radians(170), -1.2, 1.2, 0.0, 0.3, 0.0])
    J = robot.jacobian(data)
    asked = J @ [0.2, 0.1, 0.1, 0.0, 0.1, 0.0]
    rates, made, names = robot.rates(data, asked)
    nearest = J[:, 1:] @ np.linalg.pinv(J[:, 1:]) @ asked
    np.testing.assert_allclose(made, nearest, atol=1e-9)
    assert rates[0] == 0.0
    assert names == ("yaw (range)",)


def test_a_gantry_at_the_end_of_its_rail_goes_on_level():
    """The car drives beyond the end of x, and turns the camera's way across by 45 degrees."""
    drives = ["motion.kind=line", "motion.x=1.15", "motion.heading_deg=45", "tracker.kind=truth"]
    scenario = load("line", [*drives, "run.duration=3", "motion.speed=0.15"])
    steps, summary = measured_run(scenario)
    across = [
        (s.truth.T_world_target.translation - s.truth.T_world_camera.translation) for s in steps
    ]
    assert across[-1][0] > 0.05
    assert abs(across[-1][1]) < 0.01
    assert summary.measures["tilt_peak_deg"] < 0.05
    assert steps[-1].joint_limits == ("x (range)",)


def hanging(folder, *changes):
    """Episode of a six-joint arm over the table whose joints turn by two turns, about a circle."""
    (folder / "arm.urdf").write_text(urdf_arm())
    robot = ["robot.kind=mjcf", f"robot.model={folder / 'arm.urdf'}", "robot.flange=tool"]
    return load("circle", [*robot, "tracker.kind=truth", *changes])


def test_a_start_that_the_way_would_take_to_an_end_is_a_whole_turn_away(tmp_path):
    base = "robot.base=[0.0, 0.45, 0.82, -90.0]"
    with Episode(hanging(tmp_path, base), seen=False) as episode:
        plain = episode.world.robot.joints(episode.world.data)
        assert episode.begun.rollout.joint == ""
    # The circle turns the last joint by one and a half turns.
    ahead = plain - 2 * np.pi * np.eye(6)[5]
    with Episode(hanging(tmp_path, base, f"robot.home=[{ahead.tolist()}]"), seen=False) as episode:
        begun = episode.world.robot.joints(episode.world.data)
        np.testing.assert_allclose(begun, plain, atol=1e-6)
        assert episode.begun.rollout.joint == ""


def test_a_joint_that_no_start_keeps_inside_is_told_before_the_run():
    with Episode(load("joint_limits", ["tracker.kind=truth"]), seen=False) as episode:
        assert remarks(episode)[0] == (
            "With this motion the joint x reaches the end of its range after 1.6 s; no other "
            "start posture was found that stays inside the ranges"
        )


def test_a_start_whose_way_stays_inside_is_kept():
    with Episode(load("arm7_line", ["tracker.kind=truth"]), seen=False) as episode:
        robot, data = episode.world.robot, episode.world.data
        begun = robot.joints(data)
        reach(robot, data, robot.eye(data))
        np.testing.assert_allclose(robot.joints(data), begun, atol=1e-6)
        assert episode.begun.rollout.room > 0.1


def test_a_joint_that_ends_where_the_robot_does_not_believe_it_is_named(tmp_path):
    """The encoder says 0.1 m more: the lift stands at 0, and the robot drives it on."""
    steps, summary = head_run(tmp_path, "believed.joint_offsets=[0.1, 0.0, 0.0]")
    assert steps[-1].joints[0] == pytest.approx(0.0, abs=1e-3)
    assert summary.outcome is Outcome.LIMIT_HIT
    assert "lift (range)" in summary.limits
