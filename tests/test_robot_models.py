"""Robot models that differ from ours: driven as they say, or refused with what is wrong."""

import re
from importlib import resources

import mujoco
import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from sim.kinematics.robot import Design, Drives, Inversion, Robot
from sim.robots import gantry

ONE_JOINT = """
<mujoco>
  <worldbody>
    <body name="slide"><joint name="x" type="slide" axis="1 0 0"/><geom size=".01" mass="1"/>
      <camera name="robot/eye" pos="0 0 1"/><site name="robot/eye" pos="0 0 {height}" quat="{turn}"/>
    </body>
  </worldbody>
  <actuator>{actuator}</actuator>
</mujoco>"""
VELOCITY = '<velocity name="x" joint="x" kv="10"/>'
INVERSION = Inversion(weakest=0.1, damping=1e-6)


def robot(actuator=VELOCITY, height=1, turn="1 0 0 0"):
    text = ONE_JOINT.format(actuator=actuator, height=height, turn=turn)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Robot(
        model, Design("mine.xml", mujoco.MjSpec(), Drives(), ((0.0,),), inversion=INVERSION)
    ), data


def test_without_a_ctrlrange_a_drive_has_no_limit():
    machine, data = robot()
    rates, _, limited = machine.rates(data, np.array([50.0, 0, 0, 0, 0, 0]))
    assert rates.tolist() == pytest.approx([50.0])
    assert not limited


def test_a_drive_may_be_slower_in_one_direction():
    machine, data = robot('<velocity name="x" joint="x" kv="10" ctrlrange="-0.2 0.5"/>')
    for asked, made in ((0.4, 0.4), (-0.4, -0.2), (0.6, 0.5)):
        rates, _, limited = machine.rates(data, np.array([asked, 0, 0, 0, 0, 0]))
        assert rates.tolist() == pytest.approx([made])
        assert limited == ("x (speed)",) * (asked != made)


WRONG = {
    "": "has no actuators: add a velocity actuator for each joint",
    '<position name="x" joint="x" kp="10"/>': (
        "the actuator 'x' cannot be used as a velocity drive, because it is not a <velocity> servo: replace it by one"
    ),
    '<motor name="x" joint="x"/>': "the actuator 'x' cannot be used as a velocity drive, because it is not a <velocity> servo: replace it by one",
    '<velocity name="x" joint="x" kv="10" gear="3"/>': (
        "the actuator 'x' cannot be used as a velocity drive, because it does not drive one joint with gear 1: give it a joint, and gear 1"
    ),
    '<velocity name="x" site="robot/eye" kv="10"/>': (
        "the actuator 'x' cannot be used as a velocity drive, because it does not drive one joint with gear 1: give it a joint, and gear 1"
    ),
    '<velocity name="x" joint="x" kv="10" ctrlrange="0 0.5"/>': (
        "the actuator 'x' cannot be used as a velocity drive, because it has the ctrlrange 0 0.5, which does not allow both directions: widen it"
    ),
}


@pytest.mark.parametrize("actuator", WRONG)
def test_another_drive_is_refused(actuator):
    with pytest.raises(ValueError, match=re.escape(WRONG[actuator])) as refused:
        robot(actuator)
    assert str(refused.value).startswith("the robot's model mine.xml")


@pytest.mark.parametrize("placed", [{"height": 0.9}, {"turn": "1 0 0.001 0"}])
def test_a_site_away_from_the_camera_is_refused(placed):
    with pytest.raises(ValueError, match="the site 'eye' is not where the camera 'eye' is: give"):
        robot(**placed)


def test_a_quaternion_and_its_negative_are_the_same_site():
    machine, _ = robot(turn="-1 0 0 0")
    assert machine.model.site("robot/eye").quat.tolist() == [-1.0, 0.0, 0.0, 0.0]


@pytest.fixture
def edited(monkeypatch):
    """Makes the gantry another robot: its file with one text replaced."""

    def edit(pattern, replacement):
        text = (resources.files("scenes") / "robots" / "gantry.xml").read_text()
        text, count = re.subn(pattern, replacement, text)
        assert count
        spec = mujoco.MjSpec.from_string(text)
        design = Design("mine.xml", spec, Drives(), ((0.0,) * 6,), inversion=gantry.INVERSION)
        monkeypatch.setattr(gantry.Config, "build", lambda config, rng: design)

    return edit


def test_a_gantry_without_ctrlranges_converges(edited):
    edited(r' ctrlrange="[^"]*"', "")
    with Episode(load("still", ["run.duration=2.5"])) as episode:
        steps = [step.light() for step in episode]
    assert not any(step.limited for step in steps)
    assert steps[-1].servo_error < 1.0


def test_an_off_centre_camera_is_servoed_to_the_middle_of_the_image(edited):
    sensor = 'resolution="320 240" sensorsize="0.004 0.003" focalpixel="300 300"'
    edited('fovy="45"', f'{sensor} principalpixel="20 -12"')
    with Episode(load("still", ["run.duration=3.0"])) as episode:
        steps = [step.light() for step in episode]
    assert steps[-1].servo_error < 1.0
    assert steps[-1].tracking_error < 1.0
    np.testing.assert_allclose(steps[-1].truth.centre, [160, 120], atol=1.0)


def test_a_robot_that_cannot_be_driven_is_a_sentence(edited):
    edited(r'<velocity name="yaw"([^>]*)kv="24"', r'<position name="yaw"\1kp="24"')
    with pytest.raises(
        Mistake, match=r"the actuator 'yaw' cannot .* is not a <velocity> servo: replace it by one"
    ):
        Episode(load("still"))
