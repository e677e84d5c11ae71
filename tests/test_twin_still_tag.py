"""A tag that stands still in a film: focal length and lever along the optical axis together."""

import cv2
import numpy as np
import pytest
from hidden_robot import CAMERA, Film, Robot
from scipy.spatial.transform import Rotation

from servo.twin.corrections import Kind, Smooth, motion
from servo.twin.mount import COUNT, Mount
from servo.twin.robot_motion import smoothed
from servo.twin.still_tag import SQUARE, StillTag, TagSightings
from servo.twin.tracks import Tracks
from tracking.sequences.sources import Picture

ROBOT = Robot(0.06, Rotation.from_rotvec([0.2, -0.1, 0.3]), np.array([0.02, -0.03, 0.04]))
FILM = Film(3, 20.0)
SIDE = 0.08
HALF = 1.52e-3
"""Half of the 95 % interval of a side found by 200 pictures whose corners have 0.1 px of noise."""
TIMES = np.arange(200) / 10
EMPTY = np.zeros((0, 1, 2))
TRACKS = Tracks(
    TIMES,
    np.zeros(0, np.int64),
    np.zeros(0, np.int64),
    EMPTY,
    EMPTY,
    EMPTY[..., 0] > 0,
    CAMERA.fx,
    0.0,
    [],
    (320, 240),
    [],
)


def fitted(stated=SIDE, focal=1.05, moves=0.0, drift=0.0):
    """The fit of a tag's corners, with noise of 0.1 px, by a camera whose focal length is `focal`
    times the given one, from a rough mount; the film's clock drifts about its middle.
    """
    R, t = FILM.pose(TIMES + drift * (TIMES - TIMES.mean()))
    middle = t[0] - R[0][:, 2] * t[0][2] / R[0][2, 2]
    rng = np.random.default_rng(0)
    tag = Rotation.from_euler("xyz", [np.pi, 0.1, 0.4]).apply(SIDE * SQUARE) + middle
    there = tag + moves * TIMES[:, None, None]
    rays = (there - t[:, None]) @ R
    seen = rays[..., :2] / rays[..., 2:] * focal
    seen += rng.normal(0, 0.1 / CAMERA.fx, seen.shape)
    times, poses = ROBOT.log(FILM)
    moved = motion(Smooth(Kind.POSES, *smoothed(times, poses), ()))
    rough = ROBOT.rotation * Rotation.from_rotvec([0.02, -0.02, 0.01])
    arm = ROBOT.rotation.inv().apply(ROBOT.lever) * (1, 1, 0)
    first = Mount(
        ROBOT.offset + 2e-3,
        rough.as_matrix(),
        arm,
        1.0,
        drift,
        np.array([0.0, 0.0, 1.5]),
        np.zeros(COUNT),
        0.0,
        0.0,
        0.0,
        0.0,
    )
    return StillTag(np.arange(200), seen, stated).fitted(moved, TRACKS, first)


def test_focal_length_and_lever_along_the_axis_are_found_together():
    found = fitted()
    errors = ROBOT.errors(found.mount)
    assert np.all(abs(errors) < found.mount.halves[:7]), errors
    assert np.degrees(abs(errors[1:4])).max() < 0.1
    assert abs(errors[4:]).max() < 2e-3
    assert found.mount.focal == pytest.approx(1.05, abs=0.003)
    assert found.half / found.side == pytest.approx(HALF, rel=0.1)
    assert found.mount.halves[7] < 0.02
    assert found.is_still
    assert found.has_size


def test_a_clock_that_drifts_changes_no_estimate():
    """By up to 20 ms, at each end of the film."""
    found = fitted(drift=2e-3)
    errors = ROBOT.errors(found.mount)
    assert np.all(abs(errors) < found.mount.halves[:7]), errors
    assert found.is_still


def test_a_wrong_side_is_found_and_a_tag_that_moves_is_told():
    found = fitted(stated=0.088)
    assert found.side == pytest.approx(SIDE, abs=2e-4)
    assert not found.has_size
    assert not fitted(moves=np.array([0.02, 0.01, 0.0])).is_still


def test_a_tag_is_looked_for_in_each_third_picture_that_can_be_decoded():
    grey = np.full((120, 160, 3), 200, np.uint8)
    seen = TagSightings()
    pictures = [Picture("a", 0.0, None), *(Picture(str(k), k / 30, grey) for k in range(7))]
    assert list(seen.watching(pictures)) == pictures
    assert seen.numbers == []


def test_a_tag_that_was_seen_is_looked_for_where_it_was_last():
    tag = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 7, 40
    )
    seen = TagSightings()
    pictures = []
    for k in range(8):
        image = np.full((120, 240, 3), 255, np.uint8)
        image[40:80, 20 + 20 * k : 60 + 20 * k] = tag[..., None]
        image[40:80, 190:230] = tag[..., None]  # the same tag again, beside the first one's path
        pictures.append(Picture(str(k), k / 30, image))
    list(seen.watching(pictures))
    assert seen.numbers == [0, 3, 6]
    assert [round(c[:, 0].min()) for c in seen.corners] == [20, 80, 140]
