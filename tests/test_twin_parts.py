"""What a pre-flight makes of a log and a film, part by part: the points of a film, the mistakes of a
log, the verdict with its limits, and what is drawn.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from servo.cli import preflight_command
from servo.cli.main import app
from servo.cli.preflight_command import Given, after
from servo.loop.episode import Episode
from servo.output.formats import Made
from servo.report.words import Badge, Tone
from servo.scenario.load import load
from servo.twin import section
from servo.twin.compare import Comparison
from servo.twin.corrections import (
    Correction,
    Frame,
    Kind,
    Smooth,
    corrections,
    disguises,
    millimetres,
    mixed,
    motion,
    turned,
)
from servo.twin.corrections import rates as wrong_rates
from servo.twin.diagnosis import Diagnosis, Trial
from servo.twin.mount import Mount, camera_poses
from servo.twin.offset import OFFSETS, Offset
from servo.twin.replay import room_of, turned_by, write_replay
from servo.twin.robot_motion import RobotMotion, of_twists
from servo.twin.scene_camera import SceneCamera
from servo.twin.tracks import Tracks, corners, follow
from servo.twin.verdict import (
    Finding,
    Fits,
    State,
    Trust,
    Verdict,
    believed_mount,
    judge,
    preferred,
    second_axes,
)
from servo.twin.wiggle import rates, swings
from sim.camera.distortion import Distortion
from sim.camera.lens import Lens
from sim.types import Camera, Pose
from tracking.sequences.sources import Picture

CAMERA = Camera(100.0, 100.0, 80.0, 60.0, 160, 120)
GRID = np.arange(0, 2, 0.005)


def wall(size=(200, 260)):
    noise = np.random.default_rng(1).uniform(0, 255, size).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2)
    return np.clip(128 + 6 * (smooth - 128), 0, 255).astype(np.uint8)


def film(shifts, factor=1, light=1.0):
    """Pictures 160 x 120 px, or larger by a factor, of a wall that moves by these shifts [px]."""
    texture = (light * wall()).astype(np.uint8)
    for k, (x, y) in enumerate(shifts):
        image = texture[40 - y : 160 - y, 50 - x : 210 - x]
        image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
        yield Picture(f"{k}", k / 10, np.repeat(image[..., None], 3, axis=2))


SHIFTS = [(2 * k, -k) for k in range(5)]


def test_points_are_followed_over_one_and_over_three_pictures():
    notes = []
    tracks = follow(film(SHIFTS), lambda w, h: CAMERA, notes.append)
    assert list(zip(tracks.first.tolist(), tracks.second.tolist(), strict=True)) == [
        (0, 1), (1, 2), (2, 3), (0, 3), (3, 4)
    ]  # fmt: skip
    for k, steps in enumerate((1, 1, 1, 3, 1)):
        moved = (tracks.after[k] - tracks.before[k])[tracks.known[k]] * 100
        np.testing.assert_allclose(np.median(moved, axis=0), (2 * steps, -steps), atol=0.02)
    assert len(notes) == 5
    assert notes[0] == f"{len(corners(wall()[40:160, 50:210]))} points"
    assert (tracks.size, tracks.focal, tracks.dark, tracks.cuts) == ((160, 120), 100.0, 0.0, [])
    np.testing.assert_allclose(tracks.times, np.arange(5) / 10)
    assert len(tracks.middles) == 1
    assert tracks.steps.second.tolist() == [1, 2, 3, 4]
    third = tracks.only(tracks.first == 1, 3)
    np.testing.assert_array_equal(third.before, tracks.before[1:2, ::3])
    assert tracks.only(tracks.first == 1).known.shape == (1, 144)


def test_a_wide_film_is_followed_in_smaller_pictures():
    tracks = follow(film(SHIFTS[:2], factor=6), lambda w, h: CAMERA, lambda _: None)
    assert tracks.size == (960, 720)
    assert tracks.focal == pytest.approx(50)
    moved = (tracks.after[0] - tracks.before[0])[tracks.known[0]] * 100
    np.testing.assert_allclose(np.median(moved, axis=0), (12, -6), atol=0.1)
    places = 100 * tracks.before[0][tracks.known[0]] + (80, 60)
    assert places.min() > 12
    assert places.max() < 960


def test_a_dark_film_and_a_jump_are_noticed():
    jump = [(0, 0), (1, 0), (-45, 38), (-44, 38), (-43, 38)]
    tracks = follow(film(jump, light=0.03), lambda w, h: CAMERA, lambda _: None)
    assert tracks.dark == 1.0
    tracks = follow(film(jump), lambda w, h: CAMERA, lambda _: None)
    assert tracks.cuts == [0.2]
    assert tracks.second.tolist() == [1, 4]


@pytest.mark.parametrize(("light", "dark"), [(11, 1.0), (12, 0.0)])
def test_a_picture_is_dark_where_its_brightest_parts_are_below_12(light, dark):
    one = np.full((120, 160, 3), light, np.uint8)
    pictures = [Picture(f"{k}", k / 10, one) for k in range(2)]
    assert follow(pictures, lambda w, h: CAMERA, lambda _: None).dark == dark


@pytest.mark.parametrize(("width", "cuts"), [(34, [0.1]), (44, [])])
def test_a_film_is_cut_where_less_than_a_quarter_of_the_points_goes_on(width, cuts):
    """24 or 29 % of the 127 points are found in what stays of the picture, at its left."""
    before, after = wall()[:120, :160], wall()[80:, 100:]
    after[:, :width] = before[:, :width]
    pictures = [
        Picture(f"{k}", k / 10, np.repeat(image[..., None], 3, axis=2))
        for k, image in enumerate((before, after))
    ]
    assert follow(pictures, lambda w, h: CAMERA, lambda _: None).cuts == cuts


def test_a_film_of_one_picture_is_refused_and_ctrl_c_ends_a_longer_one():
    with pytest.raises(
        ValueError,
        match=r"^this film has fewer than two pictures that can be decoded: record it again, or convert it to another format$",
    ):
        follow(film(SHIFTS[:1]), lambda w, h: CAMERA, lambda _: None)
    for stop, count in ((29, None), (30, 30)):
        left = iter(range(1, stop))

        def tick(_, left=left):
            if next(left, None) is None:
                raise KeyboardInterrupt

        if count is None:
            with pytest.raises(KeyboardInterrupt):
                follow(film([(0, 0)] * 40), lambda w, h: CAMERA, tick)
        else:
            assert len(follow(film([(0, 0)] * 40), lambda w, h: CAMERA, tick).times) == count


def test_corners_are_at_most_three_of_each_cell_and_not_at_the_edge():
    grey = np.zeros((120, 160), np.uint8)
    grey[50:, 70:] = 255
    [corner] = corners(grey)
    np.testing.assert_allclose(corner, (70, 50), atol=1)
    found = corners(wall()[:120, :160])
    cells, counts = np.unique(found // 20, axis=0, return_counts=True)
    assert len(cells) == 47  # one at the edge has none
    assert counts.max() == 3
    assert found.min() >= 7
    assert (found.max(axis=0) <= (152, 112)).all()


def log(kind, values, names=()):
    return Smooth(kind, GRID, np.asarray(values, float), names)


def named(smooth):
    return {each.mistake: each for each in corrections(smooth)}


POSE = [1, 2, 3, 0.1, 0.2, 0.3, 0.9]


@pytest.mark.parametrize(
    ("mistake", "values", "usual"),
    [
        ("the axes of the position are exchanged: its columns x, y, z are y, z, x", [3, 1, 2, 0.1, 0.2, 0.3, 0.9], False),
        ("the axes of the position are exchanged: its columns x, y, z are x, z, y", [1, 3, 2, 0.1, 0.2, 0.3, 0.9], False),
        ("the sign of y of the position is wrong", [1, -2, 3, 0.1, 0.2, 0.3, 0.9], True),
        ("the position has the wrong sign in all axes", [-1, -2, -3, 0.1, 0.2, 0.3, 0.9], False),
        ("the axes of the quaternion's vector are exchanged: its columns x, y, z are z, y, x", [1, 2, 3, 0.3, 0.2, 0.1, 0.9], False),
        ("the sign of z of the quaternion's vector is wrong", [1, 2, 3, 0.1, 0.2, -0.3, 0.9], False),
        ("the quaternion's numbers are in the order w, x, y, z", [1, 2, 3, 0.2, 0.3, 0.9, 0.1], True),
        ("the quaternion's numbers are in the order y, z, w, x", [1, 2, 3, 0.9, 0.1, 0.2, 0.3], False),
        ("the axes x and z are exchanged in position and orientation", [3, 2, 1, 0.3, 0.2, 0.1, 0.9], False),
    ],
)  # fmt: skip
def test_a_correction_of_poses_takes_its_mistake_back(mistake, values, usual):
    found = named(log(Kind.POSES, [POSE]))
    assert len(found) == 26
    np.testing.assert_allclose(found[mistake].change(np.array([POSE])), [values])
    assert found[mistake].is_usual is usual


def test_the_columns_of_a_quaternion_are_named_with_what_they_hold():
    names = [f"hand_{each}" for each in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
    found = named(log(Kind.POSES, [POSE], names))
    assert found["the quaternion's numbers are in the order w, x, y, z"].remedy == (
        "log each part of the quaternion in the column of its name: now hand_qx holds w, hand_qy "
        "holds x, hand_qz holds y, hand_qw holds z (w is the cosine)"
    )


def test_inverse_poses_are_turned_back():
    R, place = Rotation.from_rotvec([0.1, -0.4, 0.3]), np.array([0.2, 0.5, -0.1])
    back = np.hstack([-R.inv().apply(place), R.inv().as_quat()])
    [found] = named(log(Kind.POSES, [POSE]))[
        "the poses are inverse: of the base in the hand's frame"
    ].change(back[None])
    np.testing.assert_allclose(found[:3], place)
    np.testing.assert_allclose(Rotation.from_quat(found[3:]).as_matrix(), R.as_matrix())


@pytest.mark.parametrize(
    ("mistake", "values", "usual"),
    [
        ("the axes of w are exchanged: its columns x, y, z are y, x, z", [1, 2, 3, 5, 4, 6], False),
        ("the sign of x of v is wrong", [-1, 2, 3, 4, 5, 6], True),
        ("w has the wrong sign in all axes", [1, 2, 3, -4, -5, -6], False),
        ("the axes y and z are exchanged in v and w", [1, 3, 2, 4, 6, 5], False),
        ("w is in degrees", [1, 2, 3, *np.radians([4, 5, 6])], True),
        ("v and w are exchanged: the angular part comes first", [4, 5, 6, 1, 2, 3], True),
        ("the twist is that of the base in the hand's frame", [-1, -2, -3, -4, -5, -6], False),
    ],
)
def test_a_correction_of_twists_takes_its_mistake_back(mistake, values, usual):
    found = named(log(Kind.TWISTS, [range(1, 7)]))
    assert len(found) == 26
    np.testing.assert_allclose(found[mistake].change(np.arange(1.0, 7)[None]), [values])
    assert found[mistake].is_usual is usual


def test_corrections_of_joints_change_one_two_or_all_angles():
    names = ("joint_a_rad", "joint_b_m", "joint_c_rad")
    found = named(log(Kind.JOINTS, [[1, 2, 3]], names))
    changed = {
        name: each.change(np.array([[1.0, 2, 3]]))[0].tolist()
        for name, each in found.items()
        if each.change
    }
    assert changed == {
        "the sign of joint_a_rad is wrong": [-1, 2, 3],
        "the sign of joint_b_m is wrong": [1, -2, 3],
        "the sign of joint_c_rad is wrong": [1, 2, -3],
        "joint_a_rad and joint_c_rad are exchanged": [3, 2, 1],
        "the joints' angles are in degrees": pytest.approx([np.radians(1), 2, np.radians(3)]),
    }
    assert found["the film is mirrored"].flips == (-1, 1)
    assert found["the film is mirrored"].is_usual
    [mm] = millimetres(log(Kind.JOINTS, [[1, 2, 3]], names)).change(np.array([[1.0, 2000, 3]]))
    assert mm.tolist() == [1, 2, 3]
    [mm] = millimetres(log(Kind.POSES, [POSE])).change(np.array([[1000.0, 2000, 3000, 4, 5, 6, 7]]))
    assert mm.tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_joints_in_degrees_are_among_the_mistakes_that_hide_the_motion():
    rates = [each.mistake for each in wrong_rates()]
    names = ("joint_a_rad", "joint_b_m")
    joints, slides = (
        [each.mistake for each in disguises(log(Kind.JOINTS, [values], of))]
        for values, of in (([1, 2], names), ([2], names[1:]))
    )
    assert joints == [*rates, "the joints' angles are in degrees"]
    assert slides == rates
    assert [each.mistake for each in disguises(log(Kind.POSES, [POSE]))] == rates


def test_films_of_another_rate_are_stretched():
    found = {each.mistake: each.stretch for each in wrong_rates()}
    assert len(found) == 7 - 2  # 15 at 30 and 30 at 60 are the same, so are their inverses
    assert found["the film's times run 0.5 times as fast as the log's"] == 2
    assert found["the film's times run 1.2 times as fast as the log's"] == pytest.approx(5 / 6)


def test_twists_of_other_frames_give_the_same_motion():
    """The hand turns about z and slides along its own x."""
    turn, speed = 0.7, 0.1
    own = np.tile([speed, 0, 0, 0, 0, turn], (len(GRID), 1))
    angles = turn * GRID
    ahead = speed * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    base = np.hstack([ahead, own[:, 3:]])
    wanted = of_twists(GRID, own)
    for frames in ((Frame.BASE, Frame.BASE), (Frame.BASE, Frame.HAND)):
        found = motion(log(Kind.TWISTS, base), Correction("", "", frames=frames))
        np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-3)
        np.testing.assert_allclose(found.turns, wanted.turns, atol=1e-9)
    tilted = np.tile([0, 0, 0, 0.5, 0, 0], (len(GRID), 1)) + [0, 0, 0, 0, 0.3, 0]
    hand = of_twists(GRID, tilted)
    into = Rotation.from_quat(hand.turns)
    found = motion(
        log(Kind.TWISTS, np.hstack([0 * own[:, :3], into.apply(tilted[:, 3:])])),
        Correction("", "", frames=(Frame.BASE, Frame.BASE)),
    )
    np.testing.assert_allclose(found.turns[-1], hand.turns[-1], atol=1e-3)
    doubled = Smooth(
        Kind.JOINTS,
        GRID,
        GRID[:, None],
        ("joint_a_m",),
        lambda q: np.hstack([2 * q, 0 * q, 0 * q, 0 * q, 0 * q, 0 * q, 0 * q + 1]),
    )
    np.testing.assert_allclose(motion(doubled).positions[:, 0], 2 * GRID)


def test_swings_begin_by_seed_0_and_size_1():
    units, times = ("m", "rad"), np.arange(500) / 50
    np.testing.assert_array_equal(swings(units, times), swings(units, times, 0, 1.0))
    np.testing.assert_allclose(swings(units, times, 0, 2.0), 2 * swings(units, times))
    for one, other in zip(rates(units), rates(units, 0, 1.0), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(rates(units, size=3.0)[1], 3 * rates(units)[1])
    assert not np.allclose(swings(units, times, 1), swings(units, times))


def test_the_wiggle_is_the_same_whenever_it_is_written():
    """A robot that has played it once, slowly and with care, plays it again."""
    times, values = rates(("m", "rad"))
    np.testing.assert_array_equal(times, np.arange(1501) / 50)
    np.testing.assert_allclose(
        values[[50, 400, 1000, 1450]],
        [[0.009686, 0.062196], [0.033419, 0.131744], [-0.003663, -0.067569], [-0.049567, 0.012481]],
        atol=1e-6,
    )


def mount(**changes):
    halves = np.array([1e-3, *[0.01] * 3, *[2e-3] * 3, 0.0, 0.0, *[0.01] * 3])
    plain = Mount(
        0.05, np.eye(3), np.array([0.02, 0.0, 0.01]), 1.0, 0.0, np.array([0, 0, 2.0]), halves,
        0.1, 0.2, 0.1, 0.1,
    )  # fmt: skip
    return replace(plain, **changes)


OFFSET = Offset(0.04, 0.002, 5.0, OFFSETS, OFFSETS**2, at_end=False)
TRACKS = Tracks(
    np.arange(10) / 10, np.arange(9), np.arange(1, 10), np.zeros((9, 4, 2)), np.zeros((9, 4, 2)),
    np.ones((9, 4), bool), 100.0, 0.0, [], (160, 120), [],
)  # fmt: skip
STRONG = (0.02, 0.1)
SIGN = Correction("the sign is wrong", "change the sign")


def diagnosed(*given, others=(), cost=0.1, share=1.0):
    trial = Trial(given, cost, mount(), share)
    return Diagnosis(trial, list(others), trial, 0.1)


def verdict(
    offset=OFFSET,
    diagnosis=None,
    at=None,
    tracks=TRACKS,
    axes=STRONG,
    believed=None,
    focal=True,
    along=None,
    stamped=True,
    stands=False,
    late=0.0,
    **stated,
):
    fits = Fits(
        offset, diagnosis or diagnosed(), at or mount(), at or mount(), tracks, axes, stands
    )
    return judge(fits, Trust(focal, along, believed, late, stamped=stamped, **stated))


def rows(found):
    return {each.what: each.found for each in found.findings}


def test_a_good_recording_gives_numbers_with_their_intervals():
    found = verdict()
    assert found.is_good
    assert rows(found) == {
        "log and film": "fit each other as they are",
        "clock offset": "50.00 ms, +- 1.00: a picture with the stamp t was taken at t + offset on the "
        "log's clock (middle of its exposure, middle row)",
        "mount: rotation": "roll 0.00, pitch 0.00, yaw 0.00 deg, +- 0.57",
        "mount: lever": "x 20.0, y 0.0, z 10.0 mm, +- 2.0",
        "distance of the scene": "0.500 m",
    }
    assert (found.has_rotation, found.has_lever, found.mistakes, found.doubts) == (
        True,
        True,
        [],
        [],
    )
    level = Rotation.from_euler("xyz", [-0.001, 0, -0.002], degrees=True).as_matrix()
    assert rows(verdict(at=mount(rotation=level)))["mount: rotation"].startswith(
        "roll 0.00, pitch 0.00, yaw 0.00 deg"
    )
    turned = verdict(
        at=mount(rotation=Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix())
    )
    assert rows(turned)["mount: rotation"] == "roll 10.00, pitch 20.00, yaw 30.00 deg, +- 0.57"


def test_the_offset_is_of_the_stamp_where_exposure_and_readout_are_known():
    said = rows(verdict(late=0.01))
    assert said["clock offset"].endswith("on the log's clock (end of its exposure, last row)")


@pytest.mark.parametrize(("late", "change"), [(0.0051, "add 5.10 ms to the stamp of each picture"), (-0.0051, "add -5.10 ms to the stamp of each picture"), (0.0049, "")])  # fmt: skip
def test_a_late_clock_is_to_be_adjusted(late, change):
    found = verdict(at=mount(offset=late))
    [row] = [each for each in found.findings if each.what == "clock offset"]
    assert (row.change, found.is_good) == (change, True)


HALVES = mount().halves


@pytest.mark.parametrize(
    ("changes", "row", "sentence"),
    [
        ({"offset": replace(OFFSET, depth=2.99)}, "clock offset", "the motion in the film does not show it (depth of the curve 2.99, at least 3 is needed)"),
        ({"offset": replace(OFFSET, at_end=True)}, "clock offset", "the best one is at the end of the search of 1 s"),
        ({"offset": replace(OFFSET, half=0.0211)}, "clock offset", "it is uncertain by 21 ms (at most 20)"),
        ({"offset": replace(OFFSET, half=0.0211)}, "mount: rotation", "the clock offset is not known"),
        ({"offset": replace(OFFSET, half=0.0211)}, "mount: lever", "its rotation is not known"),
        ({"axes": (0.0049, 0.019)}, "mount: rotation", "the hand moves along or about one axis only"),
        ({"axes": (0.0049, 0.019)}, "clock offset", "40.00 ms, +- 2.00: a picture with the stamp t was taken at t + offset on the log's clock (middle of its exposure, middle row)"),
        ({"axes": (0.006, 0.019)}, "mount: lever", "the hand turns at 0.019 rad/s about its second axis (at least 0.02)"),
        ({"diagnosis": diagnosed(Correction("", "", frames=(Frame.BASE, Frame.BASE)))}, "mount: rotation", "motion in another frame does not show how the hand is turned in it"),
        ({"diagnosis": diagnosed(cost=0.17)}, "mount: rotation", "neither the log as it is nor any mistake of the list explains the film"),
        ({"diagnosis": diagnosed(cost=0.17)}, "log and film", "do not fit each other, and no mistake of the list explains it"),
        ({"at": mount(scatter=3.1)}, "mount: rotation", "no plane fits the scene (scatter 3.1, at most 3)"),
        ({"at": mount(plane=np.zeros(3))}, "mount: rotation", "no plane fits the scene (scatter 0.2, at most 3)"),
        ({"at": mount(halves=HALVES * [1, 1, 3.6, 1, 1, 1, 1, 1, 1, 1, 1, 1])}, "mount: rotation", "it is uncertain by 2.1 deg (at most 2)"),
        ({"at": mount(halves=HALVES * [1, 1, 1, 1, 1, 1, 16, 1, 1, 1, 1, 1])}, "mount: lever", "it is uncertain by 32 mm (at most 30)"),
        ({"focal": False}, "mount: lever", "a lever along the optical axis looks as a wrong focal length does"),
        ({"diagnosis": diagnosed(SIGN)}, "mistake", "the sign is wrong"),
        ({"diagnosis": diagnosed(SIGN, others=[Trial((SIGN,), 0.1, mount(rotation=np.diag([1.0, -1, -1])), 1.0)])}, "mistake", "cannot tell (the sign is wrong) from (the sign is wrong)"),
        ({"diagnosis": diagnosed(SIGN, others=[Trial((SIGN,), 0.1, mount(rotation=np.diag([1.0, -1, -1])), 1.0)])}, "mount: rotation", "it differs between the mistakes that explain the recording"),
        ({"diagnosis": diagnosed(SIGN, others=[Trial((SIGN, SIGN), 0.1, mount(), 1.0)] * 4)}, "mistake", "cannot tell (the sign is wrong)" + " from (the sign is wrong and the sign is wrong)" * 3 + " and 1 more"),
        ({"at": mount(drift=2.1e-4)}, "clock drift", "0.21 ms each second, +- 0.00"),
        ({"at": mount(focal=1.051), "focal": False, "along": 0.1}, "focal length", "1.051 times the given one, +- 0.000"),
    ],
)  # fmt: skip
def test_what_is_wrong_or_cannot_be_known_is_a_row(changes, row, sentence):
    found = verdict(**changes)
    assert not found.is_good
    assert rows(found)[row] == sentence


TIE = {
    "diagnosis": diagnosed(
        SIGN, others=[Trial((SIGN,), 0.1, mount(rotation=np.diag([1.0, -1, -1])), 1.0)]
    )
}


@pytest.mark.parametrize(
    ("changes", "row", "change"),
    [
        (TIE, "mount: rotation", "give --mount from your drawing, which tells them apart: this recording is enough"),
        (TIE, "mount: lever", ""),
        ({"focal": False}, "mount: lever", "give --calibration, --fov, --along or --tag-mm: this recording is enough"),
        ({"axes": (0.006, 0.019)}, "mount: lever", "record 30 s of the motion that `servobench preflight --wiggle FILE` writes"),
    ],
)  # fmt: skip
def test_another_recording_is_asked_for_only_where_it_helps(changes, row, change):
    [found] = [each for each in verdict(**changes).findings if each.what == row]
    assert found.change == change


@pytest.mark.parametrize(
    "changes",
    [
        {"offset": replace(OFFSET, depth=3.0, half=0.02)},
        {"axes": (0.0, 0.02)},
        {"diagnosis": diagnosed(cost=0.159)},
        {"diagnosis": diagnosed(cost=0.17, share=0.149)},
        {"at": mount(scatter=3.0, drift=2e-4)},
        {"at": mount(halves=HALVES * [1, 3.49, 1, 1, 15, 1, 1, 1, 1, 1, 1, 1])},
        {"at": mount(drift=-3e-4, halves=HALVES + [0, 0, 0, 0, 0, 0, 0, 0, 3.1e-4, 0, 0, 0])},
        {"at": mount(focal=1.049), "focal": False, "along": 0.1},
        {"at": mount(focal=0.9, halves=HALVES + [0, 0, 0, 0, 0, 0, 0, 0.11, 0, 0, 0, 0]), "focal": False, "along": 0.1},
    ],
)  # fmt: skip
def test_what_is_just_inside_a_limit_is_good(changes):
    found = verdict(**changes)
    assert found.is_good, found.findings


@pytest.mark.parametrize(
    ("kind", "frames", "is_inverse", "in_base"),
    [
        (Kind.POSES, None, False, True),
        (Kind.POSES, None, True, False),
        (Kind.TWISTS, (Frame.BASE, Frame.HAND), False, True),
        (Kind.TWISTS, (Frame.HAND, Frame.BASE), False, False),
    ],
)
def test_a_turn_that_the_hand_shows_is_one_of_the_frame_of_the_logs_positions(
    kind, frames, is_inverse, in_base
):
    """The hand looks down, so that its frame is far from the base's: turned as they are, two
    frames that differ by 40 deg were taken for a mistake in the quaternion."""
    frame = Rotation.from_rotvec([0.2, 0.4, -0.4])
    hand = Rotation.from_euler("xyz", [3.0, 0.2, 1.0])
    swings_of_hand = hand * Rotation.from_rotvec([[0.1, 0, 0], [-0.1, 0, 0]])
    times = np.array([0.0, 1.0])
    smooth = Smooth(kind, times, np.zeros((2, 7)), (), None, is_inverse)
    moved = RobotMotion(times, np.zeros((2, 3)), swings_of_hand.as_quat())
    shown = (hand.inv() * frame * hand).as_matrix()
    before = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    (found,) = turned((Correction("", "", frames=frames, turn=before),), shown, smooth, moved)
    expected = frame.as_matrix() if in_base else shown
    assert found.turn == pytest.approx(before @ expected)


def test_two_frames_of_a_kind_are_told_by_what_they_do():
    names = [each.mistake for each in mixed(Smooth(Kind.TWISTS, GRID, np.zeros((2, 6)), ()))]
    assert names == [
        "v and w are in two frames that move with the hand, and are turned against each other",
        "v is in the hand's frame, and w in the base's",
        "v is in the base's frame, and w in the hand's",
        "v and w are in two frames that are fixed, and are turned against each other",
    ]


def test_what_is_strange_in_a_film_is_a_doubt():
    film = replace(TRACKS, dark=0.31, cuts=[1.0, 2.0, 3.0, 4.0, 5.0])
    assert verdict(tracks=film).doubts == [
        "31 % of the pictures are dark: expose longer",
        "the film is cut, or jumps, 5 times (at 1.00, 2.00, 3.00, 4.00 s on the log's clock): record "
        "one without cuts",
    ]
    assert verdict(tracks=replace(TRACKS, dark=0.3)).doubts == []


def test_a_scene_of_which_a_part_moves_by_itself_shows_no_mount():
    """A real film with a hand in view, 13 % of its points, gave a mount 1.2 deg off with +- 0.7."""
    found = verdict(at=mount(stray=0.11))
    row = next(each for each in found.findings if each.what == "mount: rotation")
    assert (row.state, row.found, row.change) == (
        State.REFUSED,
        "11 % of the points (at most 10) do not move with the scene: a part of it moves by itself, "
        "or is very near",
        "record 30 s of the motion that `servobench preflight --wiggle FILE` writes, before a scene "
        "in which nothing moves",
    )
    assert (found.mount, found.offset is None, found.has_lever) == (None, False, False)
    assert verdict(at=mount(stray=0.1)).is_good
    assert verdict(at=mount(stray=0.3), stands=True).is_good
    assert not verdict(at=mount(stray=0.31), stands=True).is_good


@pytest.mark.parametrize(
    ("stated", "sentence"),
    [
        ((0.02, 0, 0.01, 0, 0, 0), None),
        ((0.02, 0, 0.01, 1.56, 0, 0), None),
        ((0.02, 0, 0.01, 1.59, 0, 0), "the rotation differs by 1.6 deg"),
        ((0.02, 0, 0.01, 0, 20, 0), "the rotation differs by 20.0 deg"),
        ((0.02, 0, 0.01, 0, 0, -90), "the camera is mounted turned by 90 deg about its z"),
        ((0.02, 0, 0.01, 82.1, 0, 0), "the camera is mounted turned by 90 deg about its -x"),
        ((0.02, 0, 0.01, 81.9, 0, 0), "the rotation differs by 81.9 deg"),
        ((0.02, 0, 0.01, 0, 0, 180), "cannot tell (the camera is mounted turned by 180 deg about its z) from (the film is upside down)"),
        ((0.02, 0.0119, 0.01, 0, 0, 0), None),
        ((0.02, 0.0121, 0.01, 0, 0, 0), "the lever differs by 12 mm"),
        ((0.02, 0, -0.04, 0, 0, 0), "the lever differs by 50 mm, most of it along the optical axis, as it would with a focal length that is wrong by 10 %"),
    ],
)  # fmt: skip
def test_a_stated_mount_is_compared_with_the_found_one(stated, sentence):
    found = verdict(believed=believed_mount(stated))
    ways = "x {:.1f}, y {:.1f}, z {:.1f}".format(*(1e3 * np.array(stated[:3])))
    states = {each.what: each.state for each in found.findings}
    off = 1e3 * np.linalg.norm(np.subtract(stated[:3], (0.02, 0, 0.01)))
    is_near = off < 12
    assert rows(found)["mount: lever"] == (
        f"x 20.0, y 0.0, z 10.0 mm, +- 2.0; stated {ways}, "
        + ("ok up to 12 mm along each axis" if is_near else f"{off:.0f} mm away")
    )
    assert states["mount: lever"] is (State.OK if is_near else State.WRONG)
    angle = np.degrees(Rotation.from_euler("xyz", stated[3:], degrees=True).magnitude())
    is_turned = angle > 1.58
    ending = f", {angle:.1f} deg away" if is_turned else ", ok up to a turn of 1.6 deg"
    assert rows(found)["mount: rotation"].endswith(ending)
    assert states["mount: rotation"] is (State.WRONG if is_turned else State.OK)
    said = rows(found).get("mount: against --mount")
    if said is not None and "180" in said:
        assert sentence.replace(" z)", " -z)") in (said, said.replace(" z)", " -z)"))
    else:
        assert said == sentence


def test_a_mount_of_the_scenario_is_named_and_the_found_one_relative_to_it():
    found = verdict(
        believed=believed_mount((0.02, 0, 0.01, 0, 20, 0)),
        stated_by="the scenario's mount",
        is_relative=True,
    )
    (row,) = (each for each in found.findings if each.what.startswith("mount: against"))
    assert (row.what, row.change) == (
        "mount: against the scenario's mount",
        "set the rotation that is found here relative to the scenario's mount, or calibrate the mount",
    )


@pytest.mark.parametrize(
    ("degrees", "half", "sentence"),
    [
        (1.95, 0.9, None),
        (2.05, 0.9, "the hand's slides are turned against its turns by 2.0 deg, +- 0.9"),
        (2.95, 1.5, None),
        (3.05, 1.5, "the hand's slides are turned against its turns by 3.0 deg, +- 1.5"),
    ],
)
def test_slides_that_are_turned_against_turns_by_2_degrees_or_two_half_intervals_are_a_mistake(
    degrees, half, sentence
):
    found = judged_beside(degrees, half)
    assert rows(found).get("mistake") == sentence
    assert found.has_rotation is (sentence is None)


def test_a_scene_that_moves_is_not_taken_for_slides_that_are_turned_against_turns():
    """A real film with a hand in view: 2.0 deg, +- 0.9, of a log without a mistake."""
    found = judged_beside(2.05, 0.9, stray=0.13)
    assert "mistake" not in rows(found)
    assert rows(found)["mount: rotation"].startswith("13 % of the points (at most 10) do not move")


def judged_beside(degrees, half, stray=0.0):
    """The verdict where a fit with slides that are turned against turns finds so many degrees."""
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    turned = mount(turn=turn, halves=np.radians(np.full(12, half)), stray=stray)
    fits = Fits(OFFSET, diagnosed(), mount(stray=stray), turned, TRACKS, STRONG)
    return judge(fits, Trust(focal=True))


def test_a_stated_mount_decides_between_equal_explanations():
    far = Trial(
        (SIGN,), 0.1, mount(rotation=Rotation.from_euler("x", 40, degrees=True).as_matrix()), 1.0
    )
    near = Trial(
        (SIGN,), 0.1, mount(rotation=Rotation.from_euler("x", 29, degrees=True).as_matrix()), 1.0
    )
    first = diagnosed(others=[far, near])
    assert preferred(first, None) is first
    assert preferred(first, believed_mount((0.0,) * 6)).others == []
    assert preferred(first, believed_mount((0, 0, 0, -20.0, 0, 0))).others == [near]
    turned = preferred(first, believed_mount((0, 0, 0, 36.0, 0, 0)))
    assert (turned.best, turned.others) == (far, [near])


def test_the_inverse_of_a_motion_is_that_of_the_base_in_the_hands_frame():
    turns = Rotation.from_rotvec(np.outer(GRID, [0.3, -0.2, 0.5]))
    there = RobotMotion(GRID, np.outer(GRID, [1.0, 2, 3]), turns.as_quat())
    R, t = there.at(GRID[10:20])
    back, place = there.inverse.at(GRID[10:20])
    np.testing.assert_allclose(back, R.transpose(0, 2, 1), atol=1e-9)
    np.testing.assert_allclose(place, -np.einsum("kji,kj->ki", R, t), atol=1e-5)


def test_the_second_axis_of_a_motion_is_the_second_strongest():
    twists = np.tile([0.3, 0.0, 0.0, 0.0, 0.0, 0.0], (len(GRID), 1))
    twists[:, 1] = 0.1 * np.sign(np.sin(2 * np.pi * GRID))
    film = replace(TRACKS, times=np.array([0.0, 1.0]))
    slides, turns = second_axes(of_twists(GRID, twists), film)
    assert slides == pytest.approx(0.1, rel=0.03)
    assert turns == pytest.approx(0, abs=1e-9)


def test_a_camera_is_behind_the_hand_by_its_mount():
    turn = Rotation.from_euler("z", 90, degrees=True)
    held = RobotMotion(
        GRID, np.tile([1.0, 2, 3], (len(GRID), 1)), np.tile(turn.as_quat(), (len(GRID), 1))
    )
    at = mount(
        rotation=Rotation.from_euler("x", 90, degrees=True).as_matrix(), arm=np.array([0, 0, 0.5])
    )
    [pose] = camera_poses(held, at, np.array([0.5]))
    np.testing.assert_allclose(pose.translation, [1.5, 2, 3], atol=1e-9)
    np.testing.assert_allclose(pose.rotation @ [0, 0, 1], [1, 0, 0], atol=1e-9)
    vector, place = turned_by(believed_mount((0.1, -0.5, 0.2, 120, 0, 0)), at)
    np.testing.assert_allclose(vector, np.radians([30, 0, 0]), atol=1e-9)
    np.testing.assert_allclose(place, [0.1, 0.2, 0], atol=1e-9)


def test_the_room_is_put_below_the_camera():
    eye = Pose(np.diag([1.0, -1, -1]), np.array([0.01, 0.02, 0.5]))
    assert room_of([eye], np.array([0, 0, 2.0])) is None
    tilted = Rotation.from_euler("x", 25, degrees=True).as_matrix()
    base = Pose(tilted @ eye.rotation, tilted @ eye.translation + (0, 0, 1))
    room = room_of([base], np.array([0, 0, 2.0]))
    seen = room @ base
    np.testing.assert_allclose(seen.translation, [0, 0, 0.5], atol=1e-9)
    np.testing.assert_allclose(seen.rotation, eye.rotation, atol=1e-9)


def compared(**changes):
    still = RobotMotion(
        GRID, np.tile([0.0, 0, 0.6], (len(GRID), 1)), np.tile([1.0, 0, 0, 0], (len(GRID), 1))
    )
    steps = TRACKS.steps
    flows = np.zeros((len(steps.first), 6))
    flows[:, 0] = np.arange(len(flows))
    at = mount(offset=0.0, arm=np.zeros(3), plane=np.array([0, 0, 1 / 0.6]))
    fits = Fits(OFFSET, diagnosed(), at, at, TRACKS, STRONG)
    fitted = {name: changes.pop(name) for name in ("mount", "tracks") if name in changes}
    whole = Comparison(replace(fits, **fitted), still, flows, verdict())
    return replace(whole, **changes)


@pytest.mark.parametrize(
    ("state", "code"),
    [(State.OK, 0), (State.ADJUST, 0), (State.UNKNOWN, 0), (State.WRONG, 1), (State.REFUSED, 1)],
)
def test_the_exit_code_says_whether_the_robot_may_move(tmp_path, monkeypatch, state, code):
    rows = [Finding("row", "", "", state)]
    found = compared(verdict=Verdict(rows, [], None, None, False, False, []))
    (tmp_path / "log.csv").write_text("time_s,hand_x_m\n0,0\n1,0\n")
    monkeypatch.setattr("servo.cli.preflight_command.comparison", lambda *_: (found, CAMERA, 0.0))
    words = ["preflight", tmp_path / "log.csv", "film", "--out", tmp_path / "out"]
    assert CliRunner().invoke(app, [*map(str, words)]).exit_code == code


@pytest.mark.parametrize(
    ("mistakes", "row"),
    [
        (
            ["the sign is wrong"],
            (
                "they do not fit the logged motion, but this is wrong itself (see the row mistake)",
                "correct the log's motion, and compare again: only then the commands can be judged",
                State.UNKNOWN,
            ),
        ),
        (
            [],
            (
                "vx moves -1 times as far as commanded",
                "correct the sign of the commands of vx where the driver makes them: the film "
                "agrees with the logged motion (to change the log alone does not change the robot)",
                State.WRONG,
            ),
        ),
    ],
)
def test_commands_are_not_judged_by_a_motion_that_is_wrong_itself(monkeypatch, mistakes, row):
    given = Given(Path("log.csv"), "film")
    rate = 0.1 * np.sin(1.7 * np.arange(600) / 50)
    names = "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"
    columns = {f"measured_{name}": 0 * rate for name in names} | {"measured_vx_m_s": rate}
    table = pa.table({"time_s": np.arange(600) / 50, "command_vx_m_s": -rate} | columns)
    found = compared(verdict=Verdict([], [], None, None, False, False, mistakes))
    monkeypatch.setattr(preflight_command, "followed", lambda *_: (TRACKS, CAMERA, True))
    monkeypatch.setattr(preflight_command, "compare", lambda *_: found)
    judged, *_ = preflight_command.comparison(given, table)
    [finding] = judged.verdict.findings
    assert (finding.what, finding.found, finding.change, finding.state) == ("commands", *row)
    assert judged.verdict.mistakes == (mistakes or [row[0]])


def stood(tmp_path, monkeypatch, *words, mounted="world"):
    """Run `twin` on a comparison of a camera that stands; what click has of it, and the folder."""
    (tmp_path / "on.toml").write_text(f'camera.mounted = "{mounted}"\nrobot.kind = "free"\n')
    (tmp_path / "log.csv").write_text("time_s,hand_x_m\n0,0\n1,0\n")
    turn = Rotation.from_euler("xyz", [-100, 0, 10], degrees=True).as_matrix()
    at = mount(rotation=turn, arm=turn.T @ [0.0, -0.9, 0.75])
    found = compared(mount=at, verdict=verdict(at=at)), CAMERA, 0.0
    monkeypatch.setattr("servo.cli.twin_command.comparison", lambda *_: found)
    given = ["twin", tmp_path / "log.csv", "film", "--on", tmp_path / "on.toml", *words]
    done = CliRunner().invoke(app, [*map(str, given), "--out", str(tmp_path / "twin")])
    return done, tmp_path / "twin"


def test_the_twin_of_a_camera_that_stands_has_its_place_and_no_replay(tmp_path, monkeypatch):
    words = "--mount", "0,-0.9,0.8,-100,0,10", "--exposure-ms", "20", "--readout-ms", "30"
    done, folder = stood(tmp_path, monkeypatch, "--eye-to-hand", *words)
    assert done.exit_code == 0
    assert "no replay: the film does not show where the target is in the hand" in done.output
    scenario = load(folder / "twin.toml")
    assert scenario.camera.pose == pytest.approx((0, -0.9, 0.75, -100, 0, 10))
    assert (scenario.camera.exposure, scenario.camera.readout_ms) == (pytest.approx(0.2), 30)
    assert scenario.believed.hand_eye_mm == pytest.approx([0, -49.24, -8.68], abs=0.01)
    text = (folder / "twin.toml").read_text()
    assert "0 as soon as your program has x 0.0, y -900.0, z 750.0 mm in the base\n" in text
    assert "0 as soon as your program has roll -100.00, pitch 0.00, yaw 10.00 deg\n" in text
    assert (
        "the pre-flight with the other sign, +- 1.00 ms: 0 as soon as your driver adds 50" in text
    )
    assert sorted(each.name for each in folder.iterdir()) == ["report.html", "twin.toml"]


@pytest.mark.parametrize(("words", "mounted"), [((), "world"), (("--eye-to-hand",), "robot")])
def test_a_camera_that_stands_needs_a_scenario_in_which_it_stands(
    tmp_path, monkeypatch, words, mounted
):
    done, _ = stood(tmp_path, monkeypatch, *words, mounted=mounted)
    assert str(done.exception) == (
        f"{tmp_path / 'on.toml'}: --eye-to-hand and --on a scenario with camera.mounted = "
        '"world" belong together: give both or neither'
    )


def test_a_page_shows_the_curve_and_the_flows_of_12_s():
    [axes] = section.curve(compared()).axes
    np.testing.assert_allclose(axes.lines[0].get_xdata(), 1e3 * OFFSETS)
    assert list(axes.lines[1].get_xdata()) == [40, 40]
    low, high = axes.patches[0].get_x(), axes.patches[0].get_x() + axes.patches[0].get_width()
    assert (low, high) == pytest.approx((38, 42))
    drawn = section.flows(compared()).axes
    assert [ax.get_ylabel() for ax in drawn] == [
        "to the right [1/s]",
        "down [1/s]",
        "wider [1/s]",
        "sheared back [1/s]",
    ]
    np.testing.assert_allclose(drawn[0].lines[0].get_ydata(), np.arange(9))
    np.testing.assert_allclose(drawn[0].lines[1].get_ydata(), [4] * 9)  # only its mean is explained
    long = replace(TRACKS, times=np.arange(10) * 2.0)
    assert len(section.flows(compared(tracks=long)).axes[0].lines[0].get_xdata()) == 5


def test_a_film_without_stamps_has_no_offset_of_its_clock():
    found = verdict(tracks=replace(TRACKS, times=3 + TRACKS.times), stamped=False)
    row = next(each for each in found.findings if each.what == "clock offset")
    assert (row.found, row.change, row.state) == (
        "the film has no stamps on the log's clock; its first picture fits best at 3.050 s of the log",
        "give the stamps with which the robot's program pairs the pictures: --stamps",
        State.UNKNOWN,
    )
    assert (found.offset, found.is_good) == (None, True)


@pytest.mark.parametrize(
    ("states", "doubts", "line", "badge"),
    [
        ([State.OK], [], "ready. Next: twin", Badge("ready", Tone.GOOD)),
        ([State.OK, State.ADJUST], [], "ready, but adjust: row 1. Next: twin", Badge("ready, but adjust: row 1", Tone.PLAIN)),
        ([State.UNKNOWN, State.OK, State.UNKNOWN], [], "ready, but unknown: row 0, row 2. Next: twin", Badge("ready, but unknown: row 0, row 2", Tone.PLAIN)),
        ([State.OK], ["dark"], "ready, but in doubt. Next: twin", Badge("ready, but in doubt", Tone.PLAIN)),
        ([State.UNKNOWN, State.ADJUST], ["dark"], "ready, but adjust: row 1; unknown: row 0; in doubt. Next: twin", Badge("ready, but adjust: row 1; unknown: row 0; in doubt", Tone.PLAIN)),
        ([State.REFUSED], [], "not ready: correct what is wrong, or refused, and record again", Badge("not ready", Tone.BAD)),
        ([State.OK, State.WRONG], ["dark"], "not ready: correct what is wrong, or refused, and record again", Badge("not ready", Tone.BAD)),
    ],
)  # fmt: skip
def test_the_last_line_and_the_page_say_whether_the_robot_may_move(
    tmp_path, states, doubts, line, badge
):
    rows = [Finding(f"row {k}", "", "turn it", state) for k, state in enumerate(states)]
    found = compared(verdict=Verdict(rows, doubts, None, None, False, False, []))
    assert after(found, "twin") == line
    assert section.section(found, tmp_path, Made(command="", versions={})).verdict == badge


def test_the_last_line_asks_for_no_recording_that_is_not_needed():
    found = compared(verdict=verdict(focal=False))
    last = after(found, "twin")
    assert last == "not ready: give what is asked for above, with the same recording"


def test_a_table_has_a_word_for_each_finding():
    findings = [
        Finding("a", "fits"),
        Finding("d", "late", "add", State.ADJUST),
        Finding("b", "why", "record", State.REFUSED),
        Finding("c", "off", "turn", State.WRONG),
    ]
    table = section.table(
        SimpleNamespace(verdict=Verdict(findings, [], None, None, False, False, []))
    )
    assert [[what, badge.text, *rest] for what, badge, *rest in table.rows] == [
        ["a", "ok", "fits", ""],
        ["d", "adjust", "late", "add"],
        ["b", "refused", "why", "record"],
        ["c", "wrong", "off", "turn"],
    ]
    assert [badge.tone for _, badge, *_ in table.rows] == [Tone.GOOD, *[Tone.BAD] * 3]
    assert table.note.startswith("adjust: the robot can follow, but ")


@pytest.mark.parametrize(
    ("findings", "lead"),
    [
        ([("a", "fits")], "Log and film fit each other. "),
        ([("a", "late", "add"), ("b", "fits")], "Log and film fit each other. Lines that say what to change before the robot moves by its camera: 1."),
        ([("a", "late", "add"), ("b", "off", "turn", State.WRONG)], "Lines that say what to change before the robot moves by its camera: 2."),
    ],
)  # fmt: skip
def test_a_page_counts_all_lines_that_say_what_to_change(tmp_path, findings, lead):
    rows = [Finding(what, *words) for what, *words in findings]
    found = compared(verdict=Verdict(rows, [], None, None, False, False, []))
    assert section.section(found, tmp_path, Made(command="", versions={})).lead == lead


def test_a_replay_of_simulated_pictures_differs_by_nothing(tmp_path):
    """The film is the replay's own picture: drawn again, it is the same, and 20 levels are 20."""
    times = [0.5, 1.0, 3.0]
    notes, drawn = [], []
    with Episode(load("still"), seen=False) as episode:
        scene = SceneCamera(episode, CAMERA)
        eye = Pose(np.diag([1.0, -1, -1]), np.array([0.0, 0, 0.6]))
        image = scene.picture(eye, 0.5)
        scene.close()
        for picture in (image, np.clip(image.astype(int) + 20, 0, 255).astype(np.uint8)):
            film = [Picture("", time - 0.25, picture) for time in times]
            drawn.append(
                write_replay(film, 0.25, compared(), CAMERA, None, episode, tmp_path, notes.append)
            )
    assert drawn[0] == pytest.approx([0, 0], abs=0.5)
    assert drawn[1] == pytest.approx([20, 20], abs=1)
    assert notes[2:] == ["20.0 levels"] * 2
    assert (tmp_path / "replay.mp4").stat().st_size > 2000


def test_a_replay_has_the_lens_of_the_films_camera(tmp_path):
    bent = replace(CAMERA, distortion=Distortion("plumb_bob", (-0.35, 0.12, 0.0, 0.0, 0.0)))
    lens = Lens(bent)
    with Episode(load("still"), seen=False) as episode:
        scene = SceneCamera(episode, lens.view)
        eye = Pose(np.diag([1.0, -1, -1]), np.array([0.0, 0, 0.6]))
        seen = lens.bend(scene.picture(eye, 0.5))
        scene.close()
        film = [Picture("", 0.75, seen)]
        folder = tmp_path / "bent", tmp_path / "straight"
        for each in folder:
            each.mkdir()
        (same,), (other,) = (
            write_replay(film, 0.25, compared(), camera, None, episode, at, lambda _: None)
            for camera, at in zip((bent, CAMERA), folder, strict=True)
        )
    assert same < 0.5 < other
