"""Any part of the camera twist may move, with any weights; where none may, that is refused."""

import itertools

import numpy as np
import pytest
from servoing import OUTLINE, ROOT_AREA, facing, posture_of, task

from servo.controllers._inverse import Inverse
from servo.controllers.ibvs import Config
from servo.estimators import kalman_cv, none
from servo.features._interaction import interaction
from servo.features.points import PointFeatures
from servo.mistake import Mistake
from servo.scenario import load as s
from servo.sight import exact, shape_moments
from servo.types import DOF, Mode, Sight
from sim.types import Pose
from tracking.types import Region, State

RNG = np.random.default_rng(0)
STILL = posture_of(np.zeros(6))
KNOWN = list(itertools.product((True, False), repeat=2))
"""What trackers follow besides the place: angle and size, or not."""
SUBSETS = [names for n in range(1, 7) for names in itertools.combinations(DOF, n)]


def sight(x=0.0, y=0.0, theta=0.0, depth=1.0, known=(True, True)):
    m = shape_moments.of_polygon(Region(0.2, 0.1).corners(State(x, y, theta, 1 / depth)))
    return Sight(m, facing(m), *known)


@pytest.mark.parametrize("known", KNOWN, ids=str)
def test_any_part_of_the_twist_moves_alone_or_with_others(known):
    assert len(SUBSETS) == 63
    for dof in SUBSETS:
        controller = Config(dof=dof).build(RNG)
        controller.start(task(sight(), kalman_cv.Config().build(RNG), latency=1))
        for x in (0.05, 0.04, 0.03):
            command = controller.command(sight(x, -0.03, 0.2, 1.1, known), STILL, 1 / 30)
        held = {"vz": known[1], "wz": known[0]}
        free = [name in dof and held.get(name, True) for name in DOF]
        assert np.isfinite(command.twist).all()
        np.testing.assert_array_equal(command.twist[~np.array(free)], 0.0)
        assert bool(command.twist.any()) == any(free)
        assert command.mode is Mode.SERVOING


L = interaction(sight(0.05, -0.03, 0.2).moments, sight(0.05, -0.03, 0.2).plane, ROOT_AREA)
EVERY = np.ones(4, bool)


@pytest.mark.parametrize("factor", [1e-300, 1e-6, 1e6])
def test_only_the_ratios_of_the_weights_matter(factor):
    weights, moves = np.array([1.0, 0.5, 1.0, 0.1, 0.1, 0.2]), np.ones(6, bool)
    plain = Inverse.of(L, EVERY, moves, weights).pseudo
    scaled = Inverse.of(L, EVERY, moves, weights * factor).pseudo
    np.testing.assert_allclose(scaled, plain, rtol=1e-9, atol=1e-12)


def test_the_smallest_number_is_a_weight_like_any_other():
    one, moves = np.eye(6)[0], np.ones(6, bool)
    tiny = Inverse.of(L, EVERY, moves, 5e-324 * one).pseudo
    np.testing.assert_array_equal(tiny, Inverse.of(L, EVERY, moves, one).pseudo)
    assert np.isfinite(tiny).all()
    assert tiny[0].any()


def test_where_nothing_may_move_the_inverse_is_zero():
    for moves, weights in ((np.zeros(6, bool), np.ones(6)), (np.ones(6, bool), np.zeros(6))):
        np.testing.assert_array_equal(Inverse.of(L, EVERY, moves, weights).pseudo, 0.0)
    nothing = Inverse.of(L, np.zeros(4, bool), np.ones(6, bool), np.ones(6)).pseudo
    np.testing.assert_array_equal(nothing, 0.0)


STANDS = (
    "controller: dof and weights let no component of the twist move: name components in dof or "
    "leave it out, and give one of them a weight above 0; for a camera that stands still set "
    'controller.kind = "hold"'
)
REFUSED = {
    "controller.dof=[]": STANDS,
    "controller.weights=[0, 0, 0, 0, 0, 0]": STANDS,
    "controller={ kind = 'ibvs', dof = ['wz'], weights = [1, 1, 1, 1, 1, 0] }": STANDS,
    "controller.dof=['vx', 'vy', 'vx']": "controller: the list dof has 'vx' twice: leave one out",
    "controller.secondary=['level', 'level']": "controller: the list secondary has 'level' twice: leave one out",
    "controller.feed_forward=['xn', 'xn']": "controller: the list feed_forward has 'xn' twice: leave one out",
}


@pytest.mark.parametrize("change", REFUSED)
def test_a_camera_that_cannot_move_and_a_name_twice_are_refused(change):
    with pytest.raises(Mistake) as refused:
        s.load("line", [change])
    assert str(refused.value) == f"--set {change}: {REFUSED[change]}"


def test_no_secondary_task_and_nothing_fed_forward_are_allowed():
    found = s.load("line", ["controller.secondary=[]", "controller.feed_forward=[]"]).controller
    assert (found.secondary, found.feed_forward) == ((), ())


TURNS = (0.0, 0.0, 0.0, 1.0, 1.0, 0.0)
"""Weights that let the camera only tilt."""


def test_weights_that_only_tilt_the_camera_move_it_with_six_features():
    config = s.load("line", [f"controller.weights={list(TURNS)}"]).controller
    controller = config.build(RNG)
    features = PointFeatures()
    goal = exact.sight_of(Pose(np.eye(3), np.array([0.0, 0.0, 1.0])), OUTLINE)
    seen = exact.sight_of(Pose(np.eye(3), np.array([0.05, -0.03, 1.0])), OUTLINE)
    controller.start(task(goal, none.Config().build(RNG), latency=1, features=features))
    twist = controller.command(seen, STILL, 1 / 30).twist
    assert twist[[3, 4]].all()
    np.testing.assert_array_equal(twist[[0, 1, 2, 5]], 0.0)


def test_weights_that_only_tilt_the_camera_are_refused_with_four_features():
    controller = Config(weights=TURNS).build(RNG)
    with pytest.raises(ValueError) as refused:
        controller.start(task(sight(), kalman_cv.Config().build(RNG), latency=1))
    assert str(refused.value) == (
        "controller.weights: vx, vy, vz, wz have the weight 0, and with fewer than six features "
        "only these move by default, so the camera would stand still: give one of them a weight "
        "above 0, or name wx or wy in controller.dof"
    )
    named = Config(weights=TURNS, dof=("wx", "wy")).build(RNG)
    named.start(task(sight(), kalman_cv.Config().build(RNG), latency=1))
