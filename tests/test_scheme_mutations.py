"""A part of the schemes broken on purpose, one at a time: the reference vectors must notice."""

import json
from pathlib import Path

import numpy as np
import pytest
from schemes import features_of, pose_of, seen_in
from servoing import planar_pose as pose_of_corners
from servoing import posture_of

from servo.controllers import ibvs
from servo.estimators import none
from servo.features import hybrid, points, pose
from servo.parts import Task
from servo.sight.point_rows import point_rows
from servo.types import DOF
from sim.types import Camera, Pose

CASES = json.loads((Path(__file__).parent / "data" / "schemes_vectors.json").read_text())["cases"]
"""Tilted targets, seen from beside the goal."""
CAMERA = Camera(600.0, 600.0, 320.0, 240.0, 640, 480)
FAR = 1e-3
"""A broken part is off by more than this, in some entry."""


def situations():
    for case in CASES:
        goal = seen_in(pose_of(case["t_star"], case["thetau_star"]))
        yield case["schemes"], goal, seen_in(pose_of(case["t"], case["thetau"]), goal)


def off(scheme):
    """How far the matrix is from the reference's, largest over the cases."""
    sets = features_of(scheme)
    return max(
        np.abs(sets.matrix(seen) - expected[scheme]["L"]).max()
        for expected, _, seen in situations()
    )


def step_off(scheme, matrix):
    """How far one step of the law is from the reference's."""
    found = []
    for expected, goal, seen in situations():
        sets, rng = features_of(scheme), np.random.default_rng(0)
        law = ibvs.Config(gain=1.0, dof=DOF, matrix=matrix, fastest=100, fastest_turn=100).build(
            rng
        )
        estimator = none.Config().build(rng)
        estimator.start(sets)
        law.start(Task(goal, sets, estimator, CAMERA, np.zeros((4, 3))))
        twist = law.command(seen, posture_of(np.zeros(6)), 0.04).twist
        found.append(np.abs(twist - expected[scheme][f"v_{matrix}"]).max())
    return max(found)


def test_unbroken_parts_agree():
    assert max(off(s) for s in ("points", "pose_cdMc", "pose_cMo", "hybrid")) < 1e-9
    assert step_off("points", "mean") < 1e-9


@pytest.mark.parametrize(("module", "scheme"), [(pose, "pose_cdMc"), (hybrid, "hybrid")])
@pytest.mark.parametrize("wrong", [lambda w: np.eye(3), lambda w: right(w).T], ids=["I", "Lw'"])
def test_a_wrong_matrix_of_the_rotation(monkeypatch, module, scheme, wrong):
    monkeypatch.setattr(module, "rotation_rows", wrong)
    assert off(scheme) > FAR


right = pose.rotation_rows


def test_swapped_rows(monkeypatch):
    rows = points.corner_rows
    monkeypatch.setattr(points, "corner_rows", lambda sight: rows(sight)[::-1])
    assert off("points") > FAR


def test_the_depth_of_the_centre_for_all_corners(monkeypatch):
    def rows(sight):
        (x, y), Z = sight.corners.T, sight.pose.translation[2]
        return point_rows(x, y, np.full(4, 1 / Z))

    monkeypatch.setattr(points, "corner_rows", rows)
    assert off("points") > FAR


def test_the_mean_of_inverses_in_place_of_the_inverse_of_the_mean():
    sets = features_of("points")
    found = []
    for expected, goal, seen in situations():
        inverses = [np.linalg.pinv(sets.matrix(of)) for of in (seen, goal)]
        twist = -sum(inverses) / 2 @ sets.error(sets.values(seen), sets.values(goal))
        found.append(np.abs(twist - expected["points"]["v_mean"]).max())
    assert max(found) > FAR


def mirrored(pose):
    """The pose that looks nearly the same from far: tilted to the other side of the line of sight."""
    ray = pose.translation / np.linalg.norm(pose.translation)
    half_turn = 2 * np.outer(ray, ray) - np.eye(3)
    return Pose(half_turn @ pose.rotation @ np.diag([-1.0, -1.0, 1.0]), pose.translation)


@pytest.mark.parametrize("expected", [lambda pose: pose, mirrored], ids=["right", "mirrored"])
def test_a_wrong_expected_pose(expected):
    off = 0
    for _, _, seen in situations():
        near = pose_of_corners(seen.corners, (0.2, 0.1), expected(seen.pose))
        off += np.linalg.norm(near.rotation - seen.pose.rotation) > 0.1
    assert (off > 0) == (expected is mirrored)
