"""A part of the loop broken on purpose, one at a time: the scenarios' bounds must notice."""

from dataclasses import replace

import numpy as np
import pytest
from measured import measured_run

from servo.controllers import _law_settings
from servo.features import _interaction, moments
from servo.scenario.load import load
from servo.study.bounds import missed_bounds
from sim.kinematics.robot import Robot
from sim.world import World

pytestmark = pytest.mark.wide
"""They say nothing about the code, but whether the bounds notice: whole runs."""


def missed(name, *changes):
    """The bounds of the scenario's own tracker that the loop misses with a perfect one."""
    scenario = load(name, ["tracker.kind=truth", *changes])
    of_own = scenario.bounds.of(scenario.bounds.own)
    _, report = measured_run(scenario)
    return {
        violation.name for violation in missed_bounds(report.outcome.name, report.measures, of_own)
    }


@pytest.mark.parametrize("name", ["still", "stop_and_go", "reversal_5hz", "line"])
def test_an_unbroken_loop_keeps_the_bounds(name):
    assert not missed(name)


@pytest.mark.parametrize("row", ["row_xn", "row_yn", "row_an", "row_theta"])
def test_a_row_with_the_wrong_sign(monkeypatch, row):
    right = getattr(_interaction, row)
    monkeypatch.setattr(_interaction, row, lambda *shape: [-part for part in right(*shape)])
    assert missed("still")


def test_the_camera_motion_of_the_frame_before(monkeypatch):
    """The difference of features is paired with what moved one frame earlier."""
    right, before = World.posture, [np.zeros(6)]

    def late(world):
        posture = right(world)
        before.append(posture.twist)
        return replace(posture, twist=before.pop(0))

    monkeypatch.setattr(World, "posture", late)
    assert missed("stop_and_go")


def test_a_command_that_acts_a_frame_later_than_the_controller_knows(monkeypatch):
    right, waiting = World.step, [np.zeros(6)]

    def late(world, twist):
        waiting.append(twist)
        return right(world, waiting.pop(0))

    monkeypatch.setattr(World, "step", late)
    assert missed("reversal_5hz")


def test_the_wrong_degrees_of_freedom(monkeypatch):
    monkeypatch.setattr(_law_settings, "DOF", ("vx", "vy", "vz", "wz", "wy", "wx"))
    assert missed("still")


def test_the_wrong_features_fed_forward():
    assert "servo_rms_px" in missed("line", 'controller.feed_forward=["an", "theta"]')


@pytest.mark.parametrize("factor", [290.0, 1 / 290.0])
def test_an_in_pixels(monkeypatch, factor):
    """SERVO's trap: with the area in px^2, an is off by the focal length."""
    right = moments.of_moments
    monkeypatch.setattr(moments, "of_moments", lambda m, K: right(m, K) * [1, 1, factor, 1])
    assert missed("still")


def test_theta_measured_with_y_up(monkeypatch):
    right = moments.of_moments
    monkeypatch.setattr(moments, "of_moments", lambda m, K: right(m, K) * [1, 1, 1, -1])
    assert missed("still")


def test_a_depth_that_is_three_times_too_large():
    """The translations' gain is off by beta = 3; compensation is stable below 2 only."""
    assert missed("still", "believed.depth_factor=3")


def test_a_joint_that_drives_the_wrong_way(monkeypatch):
    right = Robot.rates

    def reversed_yaw(self, *given):
        rates, made, limited = right(self, *given)
        return rates * [1, 1, 1, -1, 1, 1], made, limited

    monkeypatch.setattr(Robot, "rates", reversed_yaw)
    assert missed("still")
