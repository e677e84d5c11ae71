"""Encoders, play and lag: what a robot reads of itself, and what its joints do."""

from math import exp

import mujoco
import numpy as np
import pytest
from dark import Dark

from sim.geometry import log_se3
from sim.miscalibration import BelievedConfig
from sim.motions import still
from sim.robots import arm, gantry, mjcf
from sim.targets import car
from sim.world import World, WorldParts

SIDEWAYS = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def world_of(kind=gantry, believed=None, **settings):
    rng = np.random.default_rng(0)
    robot, target, motion = (
        part.build(rng) for part in (kind.Config(**settings), car.Config(), still.Config())
    )
    parts = WorldParts(robot, target, motion, believed=believed or BelievedConfig())
    made = World(parts, rng, np.random.default_rng(7), Dark)
    assert made.start(np.array([160.0, 120.0]), 0.0, 1.0)
    return made


def read(world):
    return world.believed(world.posture())


def test_joints_are_read_in_whole_steps_and_with_their_offsets():
    step, offsets = 0.003, (0.02, -0.01, 0.0, 0.1, 0.0, -0.2)
    world = world_of(encoder_step=step, believed=BelievedConfig(joint_offsets=offsets))
    true = world.posture().joints
    np.testing.assert_array_equal(read(world).joints - offsets, np.rint(true / step) * step)
    at = mujoco.MjData(world.model)
    at.qpos[:] = read(world).joints
    mujoco.mj_forward(world.model, at)
    found, known = world.robot.eye(at), read(world)
    np.testing.assert_allclose(known.T_base_camera.translation, found.translation, atol=1e-12)
    np.testing.assert_allclose(known.jacobian, world.robot.jacobian(at), atol=1e-12)


@pytest.mark.parametrize("kind", [gantry, arm, mjcf])
def test_the_believed_camera_is_where_the_hand_eye_error_says(kind):
    wrong = BelievedConfig(hand_eye_rotation_deg=(20, -10, 40), hand_eye_mm=(80, 0, -30))
    world = world_of(kind, wrong, **({"mount": (0, 0, 0, 20, 30, 40)} if kind is mjcf else {}))
    off = (world.posture().T_base_camera @ wrong.hand_eye).inverse() @ read(world).T_base_camera
    np.testing.assert_allclose(log_se3(off), np.zeros(6), atol=1e-9)


def test_encoder_noise_has_its_deviation_and_reaches_the_twist():
    world, noise = (
        world_of(encoder_noise=(1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3)),
        np.repeat([1, 2], 3),
    )
    readings, twists = [], []
    for _ in range(150):
        world.step(np.zeros(6))
        known = read(world)
        readings.append(known.joints - world.posture().joints)
        twists.append(known.twist)
    np.testing.assert_allclose(np.std(readings, axis=0), 1e-3 * noise, rtol=0.2)
    # Of two readings, over a frame interval; gantry and camera have the same axes.
    np.testing.assert_allclose(np.std(twists, axis=0)[:2], np.sqrt(2) * 1e-3 * 30, rtol=0.2)


def test_a_joint_stands_while_its_motor_crosses_the_play():
    moved = []
    for play in (0.0, 0.004):
        world, along = world_of(backlash=play), []
        for sign in (1, 1, -1, -1, 1, 1):
            for _ in range(10):
                world.step(sign * SIDEWAYS)
            along.append(world.posture().joints[0])
        moved.append(np.abs(np.diff(along)))
    # Of 33 mm each, those after a reversal lose the play.
    np.testing.assert_allclose(moved[0] - moved[1], [0, 0.004, 0, 0.004, 0], atol=2e-4)


def test_the_encoder_sees_the_motor_not_the_joint():
    world = world_of(backlash=0.004)
    for sign in (1, -1):
        for _ in range(10):
            world.step(sign * SIDEWAYS)
        off = read(world).joints[0] - world.posture().joints[0]
        side = np.sign(world.robot.rates_measured(world.data)[0])
        assert off == pytest.approx(0.002 * side, abs=1e-9)


def test_a_lag_is_of_first_order():
    """The rate reaches 1 - exp(-t / tau) of what is asked, with the drive's own 15 ms before."""
    quick, slow = ({"kind": arm, "lag_ms": lag} for lag in (0.0, 200.0))
    rates = []
    for settings in (quick, slow):
        world = world_of(**settings)
        for _ in range(6):
            world.step(SIDEWAYS)
        rates.append(np.linalg.norm(world.robot.rates_measured(world.data)))
    assert rates[1] / rates[0] == pytest.approx(1 - exp(-0.2 / 0.2), rel=0.05)


@pytest.mark.parametrize(
    ("settings", "believed", "sentence"),
    [
        (
            {"encoder_noise": (0.1, 0.2)},
            {},
            "robot.encoder_noise has 2 values; it should have one for all joints, or 6 for ",
        ),
        (
            {"acceleration": (1.0, 2.0)},
            {},
            "robot.acceleration has 2 values; it should have one for all joints, or 6 for ",
        ),
        (
            {},
            {"joint_offsets": (0.1,) * 7},
            "believed.joint_offsets has 7 values; it should have one for all joints, or 6 for ",
        ),
    ],
)
def test_a_wrong_number_of_values_is_named(settings, believed, sentence):
    with pytest.raises(ValueError) as found:
        world_of(believed=BelievedConfig(**believed), **settings)
    names = ", ".join(world_of().robot.names)
    assert str(found.value) == sentence + names
