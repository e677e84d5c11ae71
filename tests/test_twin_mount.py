"""The mount, the clock and the plane that fit followed points, and what of a log is known to be wrong,
by points without noise.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from servo.twin import mount as mounts
from servo.twin.compare import rough_begin
from servo.twin.corrections import MIRRORED, Kind, Smooth, rates
from servo.twin.diagnosis import corrected, diagnose, floor_of
from servo.twin.mount import fitted, start
from servo.twin.offset import affine_flows, curve_of, explained
from servo.twin.robot_motion import RobotMotion
from servo.twin.tracks import Tracks
from servo.twin.wiggle import swings

GRID = np.arange(0, 9, 0.005)
TURN = Rotation.from_rotvec([0.05, -0.08, 0.3])
"""R_hand_camera."""
LEVER = np.array([0.03, -0.02, 0.05])
"""Position of the camera in the hand's frame [m]."""
OFFSET = 0.06
DEPTH = 0.7
FOCAL = 280.0


@pytest.fixture(scope="module")
def motion():
    """The hand's motion above a table, so that the camera looks down."""
    path = swings(("m", "m", "m", "rad", "rad", "rad"), GRID, 1)
    hand = Rotation.from_rotvec([np.pi, 0, 0]) * Rotation.from_rotvec(path[:, 3:]) * TURN.inv()
    return RobotMotion(GRID, path[:, :3], hand.as_quat())


@pytest.fixture(scope="module")
def tracks(motion):
    """Points of the table in pairs of pictures, of a clock that is 60 ms behind."""
    times = np.arange(1, 8, 1 / 15)
    R, place = motion.at(times + OFFSET)
    R, place = R @ TURN.as_matrix(), place + R @ LEVER
    first = np.repeat(np.arange(len(times) - 3), 2)
    second = first + np.tile([1, 3], len(times) - 3)
    before = np.random.default_rng(0).uniform(-0.5, 0.5, (len(first), 40, 2))
    rays = np.insert(before, 2, 1.0, axis=2) @ R[first].transpose(0, 2, 1)
    above = place[first, 2] + DEPTH - place[:, 2].mean()
    seen = place[first][:, None] - rays * (above[:, None] / rays[..., 2])[..., None]
    seen = (seen - place[second][:, None]) @ R[second]
    known = np.ones(before.shape[:2], bool)
    return Tracks(
        times, first, second, before, seen[..., :2] / seen[..., 2:], known, FOCAL, 0.0, [],
        (320, 240), [],
    )  # fmt: skip


def started(motion, tracks, offset=OFFSET, along=0.0):
    return start(motion, tracks.steps, affine_flows(tracks.steps), offset, along)


def test_the_offset_is_where_the_motion_explains_the_flow(motion, tracks):
    steps, flows = tracks.steps, affine_flows(tracks.steps)
    found = curve_of(motion, steps, flows)
    assert found.value == pytest.approx(OFFSET, abs=2e-3)
    assert (found.half, found.at_end) == (0.0, False)
    assert found.depth > 3
    grid = np.arange(0.0, 0.13, 0.02)
    assert explained(motion, steps, flows, grid)[0] == pytest.approx(OFFSET, abs=5e-3)


def test_places_without_a_point_change_no_flow(tracks):
    gone = np.zeros((len(tracks.first), 100, 2))
    gaps = replace(
        tracks,
        before=np.concatenate([tracks.before, gone], axis=1),
        after=np.concatenate([tracks.after, gone], axis=1),
        known=np.concatenate([tracks.known, np.zeros(gone.shape[:2], bool)], axis=1),
    )
    np.testing.assert_allclose(affine_flows(gaps), affine_flows(tracks), atol=1e-9)
    empty = replace(tracks, known=np.zeros_like(tracks.known))
    assert not affine_flows(empty).any()


def test_a_first_mount_is_near(motion, tracks):
    first = start(motion, tracks.steps, affine_flows(tracks.steps), OFFSET)
    assert first.offset == OFFSET
    away = (TURN.inv() * Rotation.from_matrix(first.rotation)).magnitude()
    assert away < np.radians(3)
    assert first.depth == pytest.approx(DEPTH, rel=0.1)
    assert first.arm.tolist() == [0, 0, 0]
    assert started(motion, tracks, along=0.05).arm.tolist() == [0, 0, 0.05]


def test_points_without_noise_give_the_mount(motion, tracks):
    found = fitted(motion, tracks, started(motion, tracks, OFFSET - 0.01))
    assert abs(found.offset - OFFSET) < found.halves[0]
    # Each pair's plane is held near the common one, although it tilts as the camera turns: 0.35 deg.
    np.testing.assert_allclose(found.rotation, TURN.as_matrix(), atol=7e-3)
    np.testing.assert_allclose(found.lever, LEVER, atol=5e-3)
    assert (found.focal, found.drift) == (1.0, 0.0)
    assert found.depth == pytest.approx(DEPTH, abs=0.02)
    assert found.off < 0.2
    assert found.stray == 0
    turn = (TURN.inv() * Rotation.from_matrix(found.rotation)).as_rotvec()
    assert (abs(turn) < found.halves[1:4]).all()
    assert (abs(found.arm - TURN.inv().apply(LEVER)) < found.halves[4:7]).all()
    assert found.halves[7:].tolist() == [0] * 5


def test_a_short_film_has_wide_intervals(motion, tracks):
    """Seven blocks of a second and eleven numbers to find: Student's t with one degree of freedom."""
    found = fitted(motion, tracks, started(motion, tracks))
    assert found.halves[:7] == pytest.approx(
        [0.0094, 0.0487, 0.0497, 0.0339, 0.0531, 0.0429, 0.0511], rel=0.05
    )


def test_a_fourth_of_stray_points_is_counted_and_left_out(motion, tracks):
    after = tracks.after.copy()
    after[:, ::4] += 5 / FOCAL
    found = fitted(motion, replace(tracks, after=after), started(motion, tracks))
    assert found.stray == 0.25
    np.testing.assert_allclose(found.rotation, TURN.as_matrix(), atol=7e-3)


def test_a_wrong_focal_length_is_found_where_the_lever_is_known(motion, tracks):
    wrong = replace(tracks, before=1.1 * tracks.before, after=1.1 * tracks.after, focal=FOCAL / 1.1)
    first = started(motion, wrong, along=float(TURN.inv().apply(LEVER)[2]))
    found = fitted(motion, wrong, first, (mounts.LEVER_ALONG, mounts.DRIFT))
    assert found.focal == pytest.approx(1.1, abs=5e-3)


def test_a_film_outside_of_the_log_fits_nothing(motion, tracks):
    assert fitted(motion, tracks, replace(started(motion, tracks), offset=20.0)).cost == np.inf


def log(motion, factor=1.0):
    """A log of the hand's poses, with lengths times a factor."""
    values = np.hstack([factor * motion.positions, motion.turns])
    return Smooth(Kind.POSES, motion.times, values, ())


@pytest.mark.parametrize(
    ("factor", "mistakes"), [(1.0, []), (1000.0, ["lengths are in millimetres"])]
)
def test_only_the_distance_of_the_scene_shows_millimetres(motion, tracks, factor, mistakes):
    notes = []
    found = diagnose(log(motion, factor), tracks, OFFSET, None, notes.append, search=False)
    assert [each.mistake for each in found.best.corrections] == mistakes
    assert (found.is_clean, found.others, len(notes)) == (not mistakes, [], 1)
    assert found.as_it_is is found.best
    assert found.best.mount.depth == pytest.approx(DEPTH, rel=0.05)
    np.testing.assert_allclose(found.best.mount.rotation, TURN.as_matrix(), atol=0.02)


def test_a_mirrored_film_and_one_of_another_rate_are_taken_back(motion, tracks):
    wrong = replace(
        tracks,
        times=tracks.times[0] + (tracks.times - tracks.times[0]) / 2,
        before=tracks.before * (-1, 1),
        after=tracks.after * (-1, 1),
    )
    half = next(each for each in rates() if each.stretch == 2)
    given = (MIRRORED, half)
    film = corrected(wrong, given)
    np.testing.assert_allclose(film.times, tracks.times)
    np.testing.assert_array_equal(film.after, tracks.after)
    found = diagnose(log(motion), wrong, None, None, lambda _: None, surely=given, search=False)
    assert found.best.corrections == given
    np.testing.assert_allclose(found.best.mount.rotation, TURN.as_matrix(), atol=0.02)


@pytest.mark.parametrize(("begins", "first"), [(0.0, 0.0), (0.4, 5.0)])
def test_a_film_without_stamps_begins_where_the_motion_fits_best(motion, tracks, begins, first):
    """It begins 1 s after a log that begins at `begins`; its own clock says `first` then."""
    shifted = replace(tracks, times=tracks.times - tracks.times[0] + first)
    late = replace(motion, times=motion.times + begins)
    found = rough_begin(replace(log(motion), times=late.times), shifted)
    assert first + found == pytest.approx(1.0 + OFFSET + begins, abs=0.02)


def test_a_film_of_random_points_has_the_floor_of_its_noise(tracks):
    """A plane's motion has eight numbers: random steps of 1 px are not explained by it."""
    noise = np.random.default_rng(0).normal(0, 1 / FOCAL, tracks.after.shape)
    assert floor_of(tracks) < 0.01
    assert floor_of(replace(tracks, after=tracks.after + noise)) == pytest.approx(2.2, abs=0.4)


def test_a_clock_that_drifts_has_its_offset_in_the_middle_of_the_film(motion, tracks):
    """The film's clock runs 2 ms a second too slowly, about the middle."""
    middle = (tracks.times[0] + tracks.times[-1]) / 2
    slow = replace(tracks, times=middle + (tracks.times - middle) / 1.002)
    found = fitted(motion, slow, replace(started(motion, slow), drift=0.0), (mounts.FOCAL,))
    assert found.drift == pytest.approx(2e-3, abs=2e-4)
    assert found.offset == pytest.approx(OFFSET, abs=1e-3)
    assert abs(found.drift - 2e-3) < found.halves[mounts.DRIFT]
