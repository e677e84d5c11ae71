"""Laws with an inverse of their own, against computations that share no code with them; the law that learns its matrix."""

from dataclasses import replace

import numpy as np
import pytest
from measured import measured_run
from schemes import OUTLINE, pose_of, seen_in
from scipy.linalg import expm
from servoing import posture_of

from servo.controllers import broyden, ibvs
from servo.estimators import none
from servo.features import decoupled, partitioned, weighted
from servo.loop.run_measures import Outcome
from servo.parts import Task
from servo.scenario.load import load
from servo.types import DOF
from sim.types import Camera, Pose

CAMERA = Camera(600.0, 600.0, 320.0, 240.0, 640, 480)
GAIN, DT = 1.0, 0.04
GOAL = ((0.02, -0.03, 1.0), (0.1, -0.2, 0.1))
STARTS = {
    "near": ((0.08, -0.05, 1.15), (0.19, -0.34, 0.31)),
    "turned": ((0.0, 0.0, 1.0), (0.0, 0.0, 1.4)),
    "tilted": ((0.15, -0.1, 1.3), (0.7, 0.1, 0.6)),
    "at the border": ((0.4, -0.2, 1.0), (0.2, -0.4, -0.5)),
}


def points_and_matrix(T):
    """Corners (4, 2) and their rows (8, 6), after Chaumette and Hutchinson 2006, equation 11."""
    P = OUTLINE[::-1] @ T.rotation.T + T.translation  # in the order of a sight's corners
    s = P[:, :2] / P[:, 2:]
    rows = []
    for (x, y), Z in zip(s, P[:, 2], strict=True):
        rows.append([-1 / Z, 0, x / Z, x * y, -(1 + x * x), y])
        rows.append([0, -1 / Z, y / Z, 1 + y * y, -x * y, -x])
    return s, np.array(rows)


def sigma_and_angle(s):
    first = (s[1] - s[0])[0] * (s[2] - s[0])[1] - (s[1] - s[0])[1] * (s[2] - s[0])[0]
    second = (s[2] - s[0])[0] * (s[3] - s[0])[1] - (s[2] - s[0])[1] * (s[3] - s[0])[0]
    side = s[1] - s[0]
    return 0.5 * np.log(abs(first + second) / 2), np.arctan2(side[1], side[0])


def slope(function, T, motion):
    """The change of a function of the corners with a motion of the camera, by differences."""
    step = 1e-6
    ends = [function(points_and_matrix(moved(T, sign * step * motion))[0]) for sign in (1, -1)]
    return (np.array(ends[0]) - ends[1]) / (2 * step)


def moved(T, twist):
    """The pose after the camera has moved by a twist for unit time."""
    X = np.zeros((4, 4))
    v, w = twist[:3], twist[3:]
    X[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    X[:3, 3] = v
    now = np.eye(4)
    now[:3, :3], now[:3, 3] = T.rotation, T.translation
    now = np.linalg.inv(expm(X)) @ now
    return Pose(now[:3, :3], now[:3, 3])


def corke_and_hutchinson(T, goal):
    """v_z and w_z from area and angle, each over its own rate; the rest from what they leave."""
    (s, J), (wanted, _) = points_and_matrix(T), points_and_matrix(goal)
    unit = np.eye(6)
    along, about = slope(sigma_and_angle, T, unit[2])[0], slope(sigma_and_angle, T, unit[5])[1]
    (size, angle), (size_wanted, angle_wanted) = sigma_and_angle(s), sigma_and_angle(wanted)
    v = np.zeros(6)
    v[2] = -GAIN * (size - size_wanted) / along
    v[5] = -GAIN * ((angle - angle_wanted + np.pi) % (2 * np.pi) - np.pi) / about
    rest = -GAIN * (s - wanted).ravel() - J @ v
    v[[0, 1, 3, 4]] = np.linalg.lstsq(J[:, [0, 1, 3, 4]], rest, rcond=None)[0]
    return v


def deguchi(T, goal):
    """Straight to the goal; the turn takes the corners as far as that leaves them."""
    (s, J), (wanted, _) = points_and_matrix(T), points_and_matrix(goal)
    turn = goal.rotation @ T.rotation.T
    place = goal.translation - turn @ T.translation  # of the camera, in the goal's camera
    v = np.zeros(6)
    v[:3] = -GAIN * turn.T @ place
    rest = -GAIN * (s - wanted).ravel() - J @ v
    v[3:] = np.linalg.lstsq(J[:, 3:], rest, rcond=None)[0]
    return v


def closed_loop(features, law, start, count=40):
    """Poses, and the largest difference between the twists of ours and of an own computation."""
    sets = features.build(OUTLINE)
    goal_pose, T = pose_of(*GOAL), pose_of(*start)
    goal = seen_in(goal_pose)
    rng = np.random.default_rng(0)
    controller = ibvs.Config(gain=GAIN, dof=DOF, fastest=100, fastest_turn=100).build(rng)
    estimator = none.Config().build(rng)
    estimator.start(sets)
    controller.start(Task(goal, sets, estimator, CAMERA, OUTLINE))
    apart, poses = [], [T]
    for _ in range(count):
        ours = controller.command(seen_in(T, goal), posture_of(np.zeros(6)), DT).twist
        apart.append(np.abs(ours - law(T, goal_pose)).max())
        T = moved(T, ours * DT)
        poses.append(T)
    return poses, max(apart)


@pytest.mark.parametrize("kind", [partitioned, decoupled, weighted])
def test_beside_an_inverse_of_its_own_no_motion_is_free_and_a_smooth_start_begins_at_rest(kind):
    """Eight coordinates of the corners, or six features, leave none of six components free."""
    sets = kind.Config().build(OUTLINE)
    goal = seen_in(pose_of(*GOAL))
    seen = seen_in(pose_of(*STARTS["tilted"]), goal)
    standing = posture_of(np.zeros(6))
    tilted = replace(
        standing, T_base_camera=Pose(pose_of((0, 0, 0), (2.9, 0.2, 0.1)).rotation, np.zeros(3))
    )

    def first(**settings):
        rng = np.random.default_rng(0)
        law = ibvs.Config(gain=GAIN, dof=DOF, fastest=9, fastest_turn=9, **settings).build(rng)
        estimator = none.Config().build(rng)
        estimator.start(sets)
        law.start(Task(goal, sets, estimator, CAMERA, OUTLINE))
        return law.command(seen, tilted, DT).twist

    np.testing.assert_allclose(first(secondary=("level",)), first(), atol=1e-9)
    np.testing.assert_allclose(first(smooth_start=1.0), 0.0, atol=1e-9)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(
    ("features", "law"),
    [(partitioned.Config(), corke_and_hutchinson), (decoupled.Config(), deguchi)],
    ids=["partitioned", "decoupled"],
)
def test_each_twist_of_a_closed_loop_is_that_of_the_papers_equations(features, law, start):
    _, apart = closed_loop(features, law, STARTS[start])
    assert apart < 1e-7  # the differences' step of 1e-6 is good to 1e-9


def test_the_decoupled_camera_goes_straight():
    poses, _ = closed_loop(decoupled.Config(), deguchi, STARTS["tilted"], count=150)
    seen_from_target = np.array([-T.rotation.T @ T.translation for T in poses])
    way = np.linalg.norm(np.diff(seen_from_target, axis=0), axis=1).sum()
    straight = np.linalg.norm(seen_from_target[-1] - seen_from_target[0])
    assert way / straight < 1.005


@pytest.mark.parametrize("degrees", [30, 90, 150])
def test_the_partitioned_law_turns_about_the_axis_without_a_retreat(degrees):
    """Corke and Hutchinson 2001: v_z stays zero, where image points drive the camera away."""
    goal, angle = pose_of((0, 0, 1.0), (0, 0, 0)), np.radians(degrees)
    v = corke_and_hutchinson(pose_of((0, 0, 1.0), (0, 0, angle)), goal)
    np.testing.assert_allclose(v, [0, 0, 0, 0, 0, angle], atol=1e-6)
    sets = partitioned.Config().build(OUTLINE)
    seen = seen_in(pose_of((0, 0, 1.0), (0, 0, angle)), seen_in(goal))
    error = sets.error(sets.values(seen), sets.values(seen_in(goal)))
    twist = -sets.inverse(sets.matrix(seen), error, CAMERA) @ error
    np.testing.assert_allclose(twist, [0, 0, 0, 0, 0, angle], atol=1e-9)


def test_the_camera_keeps_its_tilt_while_no_tilt_is_measured():
    sets = partitioned.Config().build(OUTLINE)
    rng = np.random.default_rng(0)
    goal = seen_in(pose_of(*GOAL))
    controller = ibvs.Config(gain=GAIN).build(rng)
    estimator = none.Config().build(rng)
    estimator.start(sets)
    controller.start(Task(goal, sets, estimator, CAMERA, OUTLINE))
    seen = seen_in(pose_of(*STARTS["near"]), goal)
    flat = replace(seen, tilt_known=False)
    twist = controller.command(flat, posture_of(np.zeros(6)), DT).twist
    error = sets.error(sets.values(seen), sets.values(goal))
    four = [0, 1, 2, 5]
    np.testing.assert_allclose(
        twist[four], -GAIN * np.linalg.pinv(sets.matrix(seen)[:, four]) @ error, atol=1e-12
    )
    assert twist[[3, 4]].tolist() == [0.0, 0.0]


def test_corners_weigh_nothing_inside_and_much_at_the_border():
    sets = weighted.Config(border=0.25).build(OUTLINE)
    at = np.array([[0.0, 0.0], [239.9, 0.0], [280.0, 0.0], [320.0, 300.0]]) / 600
    h = np.ones(14)
    h[:8] = [0.0, 0.0, 0.0, 0.0, 0.125 / 0.125, 0.0, weighted.LARGEST, weighted.LARGEST]
    goal = seen_in(pose_of(*GOAL))
    L = sets.matrix(seen_in(pose_of(*STARTS["near"]), goal))
    found = sets.inverse(L, np.append(at.ravel(), np.zeros(6)), CAMERA)
    np.testing.assert_allclose(found, np.linalg.pinv(h[:, None] * L) * h, atol=1e-9)


def test_inside_the_picture_the_weighted_law_is_position_based():
    sets = weighted.Config().build(OUTLINE)
    goal = seen_in(pose_of((0, 0, 1.0), (0, 0, 0)))
    seen = seen_in(pose_of((0.03, 0.02, 1.1), (0.1, -0.1, 0.2)), goal)
    L, values = sets.matrix(seen), sets.values(seen)
    error = sets.error(values, sets.values(goal))
    alone = np.linalg.pinv(L[8:]) @ error[8:]
    np.testing.assert_allclose(sets.inverse(L, values, CAMERA) @ error, alone, atol=1e-12)


@pytest.mark.wide
def test_the_weighted_law_keeps_the_corners_that_the_pose_alone_loses():
    start = "start.pose=[0.331, -0.106, 1.011, 21.3427, -37.3568, -107.4468]"
    _, alone = measured_run(load("small_hybrid", ["features.kind=pose", start, "run.duration=1.0"]))
    _, both = measured_run(
        load("small_hybrid", ["features.kind=weighted", start, "run.duration=6.0"])
    )
    assert alone.outcome is Outcome.TARGET_LOST
    assert both.outcome is Outcome.CONVERGED
    assert both.measures["out_of_view_pct"] == 0.0


def test_what_a_law_learns_is_the_interaction_matrix():
    T, goal = pose_of(*STARTS["near"]), seen_in(pose_of(*GOAL))
    sets = load("small_hybrid", ["features.kind=points"]).features.build(OUTLINE)
    law = broyden.Config().build(np.random.default_rng(0))
    law.start(Task(goal, sets, none.Config().build(np.random.default_rng(0)), CAMERA, OUTLINE))
    twist = np.zeros(6)
    for _ in range(60):
        twist = law.command(seen_in(T, goal), posture_of(twist), DT).twist
        T = moved(T, twist * DT)
    _, J = points_and_matrix(T)
    apart = np.linalg.norm(law._matrix - J) / np.linalg.norm(J)
    assert apart < 0.05
    for _ in range(200):
        twist = law.command(seen_in(T, goal), posture_of(twist), DT).twist
        T = moved(T, twist * DT)
    there, goal_points = points_and_matrix(T)[0], points_and_matrix(pose_of(*GOAL))[0]
    assert np.abs(there - goal_points).max() < 1e-4


@pytest.mark.parametrize(
    ("intervals", "forth"),
    [
        ([1 / 30], 6),
        ([1 / 25], 5),
        ([1 / 60], 12),
        ([1 / 5], 1),
        ([1.0], 1),
        ([1 / 30, 2 / 30, 1 / 30], None),
    ],
)
def test_each_probe_of_the_learning_law_comes_back(intervals, forth):
    """However the frame interval divides its time: 0.2 s forth, and as long back."""
    T, goal = pose_of(*STARTS["near"]), seen_in(pose_of(*GOAL))
    sets = load("small_hybrid", ["features.kind=points"]).features.build(OUTLINE)
    law = broyden.Config().build(np.random.default_rng(0))
    law.start(Task(goal, sets, none.Config().build(np.random.default_rng(0)), CAMERA, OUTLINE))
    place, steps = np.zeros(6), [[0, 0] for _ in range(6)]
    twist = np.zeros(6)
    for k in range(400):
        dt = intervals[k % len(intervals)]
        place += twist * dt
        T = moved(T, twist * dt)
        twist = law.command(seen_in(T, goal), posture_of(twist), dt).twist
        (moving,) = np.flatnonzero(twist) if np.count_nonzero(twist) == 1 else (None,)
        if moving is None:
            break
        others = np.delete(place, moving)
        np.testing.assert_allclose(others, 0.0, atol=0.01 * 0.06 * max(intervals))
        steps[moving][int(twist[moving] < 0)] += 1
    np.testing.assert_allclose(place, 0.0, atol=0.01 * 0.06 * max(intervals))
    assert min(steps) >= [1, 1]
    if forth is not None:
        assert steps == [[forth, forth]] * 6


def test_without_a_target_the_learning_law_stands():
    law = broyden.Config().build(np.random.default_rng(0))
    sets = load("small_hybrid", ["features.kind=points"]).features.build(OUTLINE)
    goal = seen_in(pose_of(*GOAL))
    law.start(Task(goal, sets, none.Config().build(np.random.default_rng(0)), CAMERA, OUTLINE))
    assert not law.command(None, posture_of(np.zeros(6)), DT).twist.any()


@pytest.mark.wide
@pytest.mark.parametrize(
    ("kind", "outcome"),
    [("points", Outcome.TIMED_OUT), ("moments", Outcome.CONVERGED)],
)
def test_half_a_turn_counts_where_the_features_tell_front_from_back(kind, outcome):
    changes = ["controller.kind=hold", f"features.kind={kind}", "run.duration=1.0"]
    _, summary = measured_run(load("turn_180_points", changes))
    assert summary.outcome is outcome
    turned = summary.measures["servo_angle_rms_deg"]
    assert turned == pytest.approx(180.0 if kind == "points" else 0.0, abs=0.2)
