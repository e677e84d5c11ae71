import numpy as np
import pytest

from sim.geometry import log_se3
from sim.motions import KINDS as MOTIONS
from sim.motions import circle, line, reversal, sine, six, spin, stop_and_go, wander

KINDS = MOTIONS.names()

RNG = np.random.default_rng(0)


def build(kind, seed=0):
    return MOTIONS.config_of(kind)().build(np.random.default_rng(seed))


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "six"])
def test_every_motion_but_one_stays_on_the_table_and_level(kind):
    motion = build(kind)
    for time in np.linspace(-1, 20, 50):
        pose = motion.at(time)
        assert pose.translation[2] == 0.0
        np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)
        assert pose.rotation[2, 2] == 1.0


@pytest.mark.parametrize("kind", KINDS)
def test_no_motion_jumps(kind):
    motion, dt = build(kind), 1e-3
    # Before the start, too: the first measured motion is over the frame interval before it.
    for time in np.linspace(-20, 20, 800):
        moved = motion.at(time + dt).translation - motion.at(time).translation
        assert np.linalg.norm(moved) < 0.5 * dt  # nothing here drives faster than 0.5 m/s


def test_line_drives_at_its_speed_along_its_heading():
    motion = line.Config(x=0.1, y=0.2, heading_deg=90.0, speed=0.3).build(np.random.default_rng())
    np.testing.assert_allclose(motion.at(2.0).translation, [0.1, 0.8, 0.0], atol=1e-12)


def test_reversal_is_a_triangle_wave():
    motion = reversal.Config(heading_deg=0.0, speed=0.1, length=0.4).build(np.random.default_rng())
    way = [motion.at(t).translation[0] for t in (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)]
    np.testing.assert_allclose(way, [0.0, 0.1, 0.2, 0.1, 0.0, -0.2, 0.0], atol=1e-12)


def test_sine_has_its_amplitude_a_quarter_period_in():
    motion = sine.Config(amplitude=0.15, frequency=0.2).build(np.random.default_rng())
    assert motion.at(1.25).translation[0] == pytest.approx(0.15)


@pytest.mark.parametrize("frequency", [0.15, -0.15])
def test_circle_has_its_nose_along_the_tangent(frequency):
    motion, h = circle.Config(frequency=frequency).build(np.random.default_rng()), 1e-6
    for time in (0.0, 1.3, 5.0):
        pose = motion.at(time)
        speed = (motion.at(time + h).translation - motion.at(time - h).translation) / (2 * h)
        np.testing.assert_allclose(pose.rotation[:, 0] @ speed, 2 * np.pi * 0.15 * 0.15, rtol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_wander_turns_gently_and_stays_near(seed):
    motion, h = wander.Config().build(np.random.default_rng(seed)), 1e-4
    tightest = np.inf
    for time in np.linspace(0, 9, 200):
        a, b, c = (motion.at(time + k * h).translation[:2] for k in (-1, 0, 1))
        v, acceleration = (c - a) / (2 * h), (a - 2 * b + c) / h**2
        turn = abs(v[0] * acceleration[1] - v[1] * acceleration[0])
        tightest = min(tightest, np.linalg.norm(v) ** 3 / turn)
        nose = motion.at(time).rotation[:2, 0]
        assert nose @ v == pytest.approx(np.linalg.norm(v), rel=1e-6)
        assert np.hypot(*b) < 0.18 * 1.3
    assert tightest > 0.1  # half a car's length is what a toy car manages


def test_wander_is_another_road_for_another_seed():
    here, there = (build("wander", seed).at(1.0).translation for seed in (0, 1))
    assert np.linalg.norm(here - there) > 1e-3


def test_stop_and_go_drives_stands_and_drives_on():
    motion = stop_and_go.Config(x=-0.5, speed=0.12, go=2.0, stop=1.5).build(RNG)
    places = [motion.at(t).translation[0] for t in (0.0, 1.0, 2.0, 3.0, 3.5, 4.5)]
    np.testing.assert_allclose(places, [-0.5, -0.38, -0.26, -0.26, -0.26, -0.14])


def test_spin_turns_on_the_spot_and_drives_along_its_nose():
    motion = spin.Config(x=0.0, y=0.0, heading_deg=0.0, turn_deg=90.0, speed=0.1).build(RNG)
    noses = [np.degrees(np.arctan2(*motion.at(t).rotation[[1, 0], 0])) for t in (0, 1, 2, 4, 5, 6)]
    np.testing.assert_allclose(noses, [0, 45, 90, 90, 135, 180], atol=1e-9)
    places = [motion.at(t).translation[:2] for t in (1.0, 2.0, 4.0, 6.0, 8.0)]
    np.testing.assert_allclose(places, [[0, 0], [0, 0], [0, 0.2], [0, 0.2], [-0.2, 0.2]], atol=1e-9)


def test_spin_drove_along_its_first_direction_before_the_start():
    motion = spin.Config(x=0.3, y=0.0, heading_deg=0.0, turn_deg=90.0, speed=0.1).build(RNG)
    places = [motion.at(t).translation[:2] for t in (-4.0, -2.0, -1.0, -1e-9, 0.0)]
    wanted = [[0.1, 0], [0.1, 0], [0.2, 0], [0.3, 0], [0.3, 0]]
    np.testing.assert_allclose(places, wanted, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_six_uses_all_of_its_room_and_no_more(seed):
    motion = six.Config().build(np.random.default_rng(seed))
    poses = [motion.at(time) for time in np.linspace(0, 120, 2401)]
    R, t = np.array([p.rotation for p in poses]), np.array([p.translation for p in poses])
    tilts = np.degrees(np.arccos(R[:, 2, 2]))
    assert 16.0 < tilts.max() <= 20.0
    for axis, middle, largest in ((0, 0.0, 0.1), (1, 0.0, 0.1), (2, 0.3, 0.1)):
        assert 0.9 * largest < np.abs(t[:, axis] - middle).max() <= largest
    turns = np.degrees(np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1]))
    assert 26.0 < np.abs(turns).max() <= 30.0
    np.testing.assert_allclose(poses[0].rotation, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(poses[0].translation, [0.0, 0.0, 0.3])


def test_six_moves_in_six_independent_ways_as_the_seed_says():
    motion, again, other = (build("six", seed) for seed in (0, 0, 1))
    times = np.linspace(0, 20, 200)
    twists = [log_se3(motion.at(t).inverse() @ motion.at(t + 0.01)) for t in times]
    assert np.linalg.matrix_rank(np.array(twists), tol=1e-3) == 6
    leans = np.array([motion.at(t).rotation[2, :2] for t in np.linspace(0, 120, 2401)])
    assert abs(np.corrcoef(leans.T)[0, 1]) < 0.5
    np.testing.assert_array_equal(motion.at(3.0).rotation, again.at(3.0).rotation)
    assert np.linalg.norm(motion.at(3.0).translation - other.at(3.0).translation) > 1e-3
