"""The quadratic programme: the law of ibvs where nothing limits it, and each limit by itself."""

from dataclasses import replace

import numpy as np
import pytest
from schemes import features_of, pose_of, seen_in
from servoing import PAPER, posture_of

from servo.controllers import ibvs, qp
from servo.controllers._bounds import view_bounds
from servo.controllers._limits import DesiredTwist
from servo.estimators import none
from servo.parts import Task
from servo.types import DOF, Prediction
from sim.camera.distortion import Distortion
from sim.geometry import exp_se3
from sim.types import Camera, Posture

CAMERA = Camera(600.0, 600.0, 320.0, 240.0, 640, 480)
GOAL = seen_in(pose_of([0.0, 0.0, 1.0], [0.0, 0.0, 0.0]))
STILL = posture_of(np.zeros(6))
DT, NO_TURN = 0.04, [0.0, 0.0, 0.0]
ASIDE = seen_in(pose_of([0.2, 0.1, 1.0], NO_TURN), GOAL)
FAST = {"gain": 1.0, "dof": DOF, "fastest": 100.0, "fastest_turn": 100.0}
LEAVING = {
    "schemes_loops": (([0.118, -0.211, 0.889], [-0.551, -0.484, 1.289]), -5.3),
    "close": (([0.102, 0.071, 0.599], [0.228, -1.381, 2.693]), -285.0),
    "far": (([-0.304, 0.342, 1.293], [0.125, 0.982, 1.257]), -100.5),
}
"""Starts, and how far outside the picture `pose` takes a corner from there [px]."""
LENS = Camera(
    600.0, 590.0, 320.0, 240.0, 640, 480, Distortion("plumb_bob", (-0.3, 0.1, 1e-3, 0, 0))
)


class Moving:
    """An estimator that knows the target's own motion, as a twist of the camera."""

    def __init__(self, features, twist):
        self.features, self.twist = features, twist

    def start(self, features):
        pass

    def update(self, error, own, dt):
        return Prediction.unmeasured(error, self.features.matrix(GOAL) @ self.twist)


def law(kind=qp, scheme="pose_cdMc", target=None, latency=0, sets=None, **config):
    sets = sets or features_of(scheme)
    estimator = none.Config().build(None) if target is None else Moving(sets, target)
    estimator.start(sets)
    controller = kind.Config(**(FAST | config)).build(np.random.default_rng())
    controller.start(Task(GOAL, sets, estimator, CAMERA, np.zeros((4, 3)), latency))
    return controller


def room(sight):
    """Way of the nearest corner to a side of the picture [px]; negative outside."""
    pixels = CAMERA.to_pixels(sight.corners)
    return np.minimum(pixels, [640.0, 480.0] - pixels).min()


def closed_loop(controller, start, steps=200, delay=0):
    """Least room and last error of a kinematic loop."""
    T, waiting, rooms = pose_of(*start), [np.zeros(6)] * delay, []
    for _ in range(steps):
        sight = seen_in(T, GOAL)
        rooms.append(room(sight))
        command = controller.command(sight, STILL, DT)
        waiting.append(command.twist)
        T = exp_se3(waiting.pop(0) * DT).inverse() @ T
    return min(rooms), np.linalg.norm(command.trace.error)


@pytest.mark.parametrize("scheme", ["pose_cdMc", "pose_cMo", "points", "hybrid", "segment"])
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"dof": ("vx", "vy", "vz", "wz"), "secondary": ("level",)},
        {"fastest": 0.05, "smooth_start": 2.0},
    ],
)
def test_without_an_active_limit_it_is_the_law_of_ibvs(scheme, settings):
    one, other = (law(kind, scheme, **settings) for kind in (ibvs, qp))
    for start in (([0.08, -0.05, 1.15], [0.09, -0.14, 0.21]), ([0.0, 0.1, 0.9], [0.3, 0.2, 1.0])):
        sight = seen_in(pose_of(*start), GOAL)
        asked, found = (c.command(sight, STILL, DT) for c in (one, other))
        np.testing.assert_allclose(found.twist, asked.twist, atol=1e-12)
        assert (found.saturated, found.violated) == (asked.saturated, ())
        assert found.limits == (("speed",) if asked.saturated else ())


@pytest.mark.parametrize("case", LEAVING)
def test_it_holds_the_target_in_view_where_pose_loses_it(case):
    start, lost = LEAVING[case]
    outside, _ = closed_loop(law(ibvs), start)
    inside, error = closed_loop(law(), start)
    assert outside == pytest.approx(lost, abs=0.5)
    assert inside > 10.0
    assert error < 1e-3


def test_commands_under_way_are_counted_in(monkeypatch):
    """With three frames of delay a corner that is about to leave is noticed in time."""
    monkeypatch.setattr(qp, "VIEW_GAIN", 20.0)
    start = LEAVING["close"][0]
    blind, _ = closed_loop(law(), start, delay=3)
    aware, error = closed_loop(law(latency=3), start, delay=3)
    assert blind < 0.0
    assert aware > 0.0
    assert error < 2e-3


SIDES = {"left": (-0.9, 0.0), "right": (0.9, 0.0), "top": (0.0, -0.9), "bottom": (0.0, 0.9)}


@pytest.mark.parametrize("side", SIDES)
def test_the_side_is_named_and_approached_exponentially(side):
    """The camera turns away from a target near a side: its corners use up their way at the gain."""
    x, y = np.array(SIDES[side]) * [320 / 600 - 0.1, 240 / 600 - 0.05]
    goal, turned = seen_in(pose_of([3 * x, 3 * y, 1.0], NO_TURN)), law(margin=5.0)
    sight = seen_in(pose_of([x, y, 1.0], NO_TURN), goal)
    command = turned.command(sight, STILL, DT)
    assert (command.limits, command.violated) == ((f"view {side}",), ())
    nearer = seen_in(exp_se3(command.twist * 1e-6).inverse() @ sight.pose)
    assert (room(nearer) - room(sight)) / 1e-6 == pytest.approx(
        -qp.VIEW_GAIN * (room(sight) - 5), rel=1e-3
    )


@pytest.mark.parametrize(("to", "side"), [(1.0, "right"), (-1.0, "left")])
def test_a_target_that_is_too_fast_is_left_with_the_least_violation(to, side):
    """It flees sideways at 0.5 m/s; the camera makes 0.2 m/s and does not turn."""
    sight = seen_in(pose_of([to * (320 / 600 - 0.13), 0.0, 1.0], NO_TURN), GOAL)
    flees = to * np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    settings = {"fastest": 0.2, "dof": ("vx", "vy", "vz")}
    command = law(target=flees, **settings).command(sight, STILL, DT)
    assert command.violated == (f"view {side}",)
    assert set(command.limits) == {"speed", f"view {side}"}
    assert np.linalg.norm(command.twist[:3]) == pytest.approx(0.2, abs=1e-9)
    assert law(target=0.3 * flees, **settings).command(sight, STILL, DT).violated == ()


def at_joints(places, limit=1.0, rate=np.inf, jacobian=None):
    """A robot whose joints are the camera's own axes."""
    J, one = np.eye(6) if jacobian is None else jacobian, np.full(6, limit)
    rates = np.full(6, rate)
    return Posture(STILL.T_base_camera, np.zeros(6), np.array(places), -one, one, J, -rates, rates)


@pytest.mark.parametrize("kind", [ibvs, qp])
def test_it_slides_along_the_limit_of_a_joint(kind):
    """The drives hold each joint before its limit, as those of the robots do."""
    controller = law(kind)
    q = np.zeros(6)
    T = pose_of([0.2, 0.15, 1.0], NO_TURN)
    names = set()
    for _ in range(200):
        command = controller.command(seen_in(T, GOAL), at_joints(q, limit=0.1), DT)
        names |= {*command.limits}
        moved = command.twist.clip(-8.0 * (q + 0.09), 8.0 * (0.09 - q)) * DT
        q, T = q + moved, exp_se3(moved).inverse() @ T
    np.testing.assert_allclose(q[:2], [0.09, 0.09], atol=1e-3)
    assert names == {"joint 1", "joint 2"}


@pytest.mark.parametrize("to", [1.0, -1.0])
def test_joints_have_rates_too(to):
    sight = seen_in(pose_of([to * 0.2, to * 0.1, 1.0], NO_TURN), GOAL)
    command = law().command(sight, at_joints(np.zeros(6), rate=0.05), DT)
    np.testing.assert_allclose(command.twist[:2], to * 0.05, atol=1e-9)
    assert command.limits == ("joint 1", "joint 2")


def test_joints_that_commands_under_way_still_move_are_counted_in():
    """Two commands of 0.2 m/s take a joint from 0.97 to 0.986, 0.004 before its margin."""
    sight = seen_in(pose_of([0.2, 0.0, 1.0], NO_TURN), GOAL)
    controller = law(latency=2)
    for places, twist in ((0.0, 0.2), (0.0, 0.2), (0.97, 8.0 * 0.004), (0.99, 0.0)):
        command = controller.command(sight, at_joints([places, 0, 0, 0, 0, 0]), DT)
        assert command.twist[0] == pytest.approx(min(twist, 0.2), abs=1e-6)


def test_a_limited_twist_changes_the_features_most_nearly_as_wanted():
    """One active limit has a closed form: H^-1 of the joint's row, scaled to meet the limit."""
    sight = seen_in(pose_of([0.3, 0.1, 1.1], [0.2, -0.1, 0.3]), GOAL)
    sight = replace(sight, angle_known=False)
    wanted = law(ibvs, sets=PAPER).command(sight, STILL, DT).twist
    i = int(wanted.argmax())
    rates = np.where(np.arange(6) == i, wanted[i] - 0.05, np.inf)
    limited = law(sets=PAPER).command(sight, replace(at_joints(np.zeros(6)), fastest=rates), DT)
    L = (PAPER.matrix(sight) / limited.trace.scales[:, None])[[0, 1, 2]]
    moves = [0, 1, 2, 3, 4]  # the angle, which alone moves wz, is not known
    step = np.linalg.inv(L[:, moves].T @ L[:, moves] + qp.DAMPING * np.eye(5))[:, i]
    expected = wanted[moves] - 0.05 * step / step[i]
    np.testing.assert_allclose(limited.twist[moves], expected, atol=1e-9)
    assert limited.twist[5] == 0.0


def test_beyond_a_limit_a_joint_may_stand():
    command = law().command(ASIDE, at_joints([2.0, 0, 0, 0, 0, 0]), DT)
    np.testing.assert_allclose(command.twist[:2], [0.0, 0.1], atol=1e-6)
    assert command.limits == ("joint 1",)


def test_a_jacobian_that_is_no_number_leaves_the_joints_out():
    unknown = at_joints(np.zeros(6), rate=0.05, jacobian=np.full((6, 6), np.nan))
    free, found = (law().command(ASIDE, p, DT).twist for p in (STILL, unknown))
    np.testing.assert_array_equal(found, free)


def test_more_joints_than_six_move_as_the_drives_do():
    """J# of two joints on one axis shares its motion: each makes half of it."""
    J, one, rates = np.eye(6)[:, [0, *range(6)]], np.ones(7), np.array([0.05, *[9.0] * 6])
    posture = Posture(STILL.T_base_camera, np.zeros(6), np.zeros(7), -one, one, J, -rates, rates)
    command = law().command(ASIDE, posture, DT)
    assert command.twist[0] == pytest.approx(0.1)
    assert command.limits == ("joint 1",)


def test_what_may_not_move_stays():
    controller = law(dof=("vx", "wz"), scheme="hybrid")
    command = controller.command(ASIDE, at_joints(np.zeros(6), rate=0.05), DT)
    np.testing.assert_array_equal(command.twist[[1, 2, 3, 4]], 0.0)
    assert command.limits == ("joint 1",)
    weighed = law(scheme="hybrid", weights=(1.0, 1.0, 1.0, 0.0, 0.0, 1.0))
    command = weighed.command(ASIDE, at_joints(np.zeros(6), rate=0.05), DT)
    np.testing.assert_array_equal(command.twist[3:5], 0.0)


def test_where_nothing_may_move_a_target_beyond_a_limit_of_the_view_changes_nothing():
    """Only the turn may move, and the angle, its only feature, is not known."""
    leaving = seen_in(pose_of([0.55, 0.0, 1.0], NO_TURN), GOAL)
    controller = law(sets=PAPER, dof=("wz",))
    command = controller.command(replace(leaving, angle_known=False), at_joints(np.zeros(6)), DT)
    np.testing.assert_array_equal(command.twist, 0.0)
    assert command.limits == ("view right",)


@pytest.mark.parametrize("camera", [CAMERA, LENS])
def test_rows_of_the_view_are_the_motion_of_the_corners_in_the_picture(camera):
    T, h = pose_of([0.1, -0.2, 0.9], [0.3, -0.4, 0.5]), 1e-6
    none, every = np.zeros(6), np.full(6, True)
    stands = DesiredTwist(none, none, np.zeros((0, 6)), every, none, seen_in(T), STILL, DT)
    bounds = view_bounds(stands, seen_in(T), camera, margin=0.0, gain=1.0)
    at = camera.to_pixels(seen_in(T).corners).T.ravel()
    np.testing.assert_allclose(bounds.lower, -at)
    np.testing.assert_allclose(bounds.upper, [640.0] * 4 + [480.0] * 4 - at)
    for i, twist in enumerate(np.eye(6)):
        moved = camera.to_pixels(seen_in(exp_se3(h * twist).inverse() @ T).corners).T.ravel()
        np.testing.assert_allclose(bounds.A[:, i], (moved - at) / h, atol=0.02)


def test_a_margin_that_leaves_nothing_is_refused():
    with pytest.raises(ValueError, match="nothing is left") as refused:
        law(margin=240.0)
    assert str(refused.value) == (
        "controller.margin = 240: nothing is left of a picture of 640 x 480 px: set a margin "
        "below 240"
    )
