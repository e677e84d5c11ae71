"""Robots of fewer than six joints: what they servo, the nearest twist, where they begin."""

from pathlib import Path

import numpy as np
import pytest
from measured import measured_run

from servo.cli.run_command import remarks
from servo.controllers._inverse import Inverse, servoed_by
from servo.features.moments import Config as Moments
from servo.loop.episode import Episode
from servo.loop.run_measures import Outcome
from servo.scenario.load import load
from sim.kinematics.workspace import movable_shares

SCENES = Path(__file__).parents[1] / "scenes"
EVERY = np.ones(4, bool)


def seen_from_above():
    """Features of a plate seen from straight above, and their interaction matrix."""
    with Episode(load("still")) as episode:
        sight = episode.running.goal_sight
        features = Moments().build(episode.world.outline)
    return features, features.matrix(sight)


def test_features_are_servoed_in_their_order_as_far_as_the_joints_move_them():
    features, L = seen_from_above()
    assert features.names == ("xn", "yn", "an", "theta")
    moves = np.eye(6)
    stage = moves[:, [0, 1, 5]]  # along x and y, and about z
    assert servoed_by(L, stage).tolist() == [True, True, False, True]
    pan_tilt = moves[:, [3, 4]]
    assert servoed_by(L, pan_tilt).tolist() == [True, True, False, False]
    scara = moves[:, [0, 1, 2, 5]]
    assert servoed_by(L, scara).tolist() == [True] * 4
    assert servoed_by(L, moves).tolist() == [True] * 4
    lift = moves[:, [2]]
    assert servoed_by(L, lift).tolist() == [False, False, True, False]
    corners = np.vstack([L, L])  # more features than degrees of freedom: all, as nearly as can be
    assert servoed_by(corners, pan_tilt).all()


def test_the_twist_is_the_best_that_the_joints_can_do():
    """Against least squares over joint rates."""
    rng = np.random.default_rng(3)
    L, J, wanted = rng.normal(size=(8, 6)), rng.normal(size=(6, 3)), rng.normal(size=8)
    twist = Inverse.through_joints(L, np.ones(8, bool), J).pseudo @ wanted
    rates, *_ = np.linalg.lstsq(L @ J, wanted, rcond=None)
    np.testing.assert_allclose(twist, J @ rates, atol=1e-12)


def test_with_all_joints_the_twist_is_that_of_the_camera():
    rng = np.random.default_rng(4)
    L, J = rng.normal(size=(4, 6)), rng.normal(size=(6, 6))
    pseudo = Inverse.through_joints(L, EVERY, J).pseudo
    np.testing.assert_allclose(L @ pseudo, np.eye(4), atol=1e-10)


@pytest.mark.parametrize("x", [-30.0, 0.0, 40.0])
def test_a_pan_tilt_begins_with_the_target_where_it_is_asked_for(x):
    with Episode(load("pan_tilt_line", [f"start.x={x}", "start.y=10.0"])) as episode:
        centre = episode.shown[2].x, episode.shown[2].y
    # 1e-3 rad are .3 px.
    np.testing.assert_allclose(centre, [160 + x, 130.0], atol=0.4)


def test_the_outcome_judges_what_two_joints_can_servo():
    scenario = load("pan_tilt_line", ["run.duration=1.5", "measure.after=1", "tracker.kind=truth"])
    steps, summary = measured_run(scenario)
    assert summary.outcome.name == "CONVERGED"
    assert steps[-1].servoed == (False, False)
    assert summary.measures["servo_scale_peak_pct"] > 20
    assert len(steps[-1].joints) == 2


def test_one_joint_follows_across(tmp_path):
    text = (SCENES / "robots" / "pan_tilt.xml").read_text()
    still = text.replace('<joint name="tilt" axis="0 1 0" range="-30 100"/>', "")
    still = still.replace(
        '<velocity name="tilt" joint="tilt" kv="20" ctrlrange="-2 2" forcerange="-20 20"/>', ""
    )
    model = tmp_path / "pan.xml"
    model.write_text(
        still.replace(
            '<body name="tilt" pos="0 0 .08"', '<body name="tilt" pos="0 0 .08" euler="0 49 0"'
        )
    )
    scenario = load(
        "pan_tilt_line", [f"robot.model={model}", "run.duration=3", "tracker.kind=truth"]
    )
    steps, _ = measured_run(scenario)
    across = [s.truth.centre[0] - s.goal.centre[0] for s in steps]
    assert steps[0].servoed == (False, False)
    assert np.abs(across[60:]).max() < 1.0
    assert np.ptp([s.joints[0] for s in steps]) > 0.1


def test_the_directions_that_a_few_joints_move():
    pan_tilt = np.eye(6)[:, [3, 4]]
    pan_tilt[5, 1] = 1.0
    shares = movable_shares(pan_tilt)
    np.testing.assert_allclose(shares, [0, 0, 0, 1, 0.5**0.5, 0.5**0.5], atol=1e-12)
    assert movable_shares(np.eye(6)[:, [2]]).tolist() == [0, 0, 1, 0, 0, 0]


def test_a_start_that_no_posture_takes_is_told():
    with Episode(load("pan_tilt_line", ["start.x=9"])) as episode:
        assert remarks(episode) == [
            "The robot cannot take the start pose: it begins where it sees the target in the "
            f"same direction, {episode.begun.distance:.2f} m and "
            f"{np.degrees(episode.begun.angle):.0f} deg from that pose"
        ]
        assert episode.begun.distance > 0.5
    with Episode(load("still")) as episode:
        assert not remarks(episode)


def test_a_tilt_that_the_depth_picture_shows_is_not_said_to_be_unmeasured():
    changes = ["target.kind=plate", "start.tilt_deg=20", "features.kind=hybrid", "robot.kind=free"]
    for plane, said in (("parallel", 1), ("picture", 0)):
        scenario = load("still", [*changes, "camera.depth=true", f"sight.plane={plane}"])
        with Episode(scenario) as episode:
            assert (
                sum("tilt of the start is not measured" in each for each in remarks(episode))
                == said
            )


@pytest.mark.wide
def test_a_tilt_that_no_tracker_reports_is_told_and_is_not_converged():
    changes = ["tracker.kind=truth", "start.tilt_deg=40", "run.duration=6"]
    scenario = load("turn_90_points", changes)
    with Episode(scenario) as episode:
        assert remarks(episode) == [
            "The tracker truth reports no corners, so the tilt of the start is not measured and "
            "not servoed; tracker.corners = true measures it"
        ]
    assert measured_run(scenario)[1].outcome is Outcome.TIMED_OUT
    seen = load("turn_90_points", [*changes, "tracker.corners=true"])
    with Episode(seen) as episode:
        assert not remarks(episode)
    assert measured_run(seen)[1].outcome is Outcome.CONVERGED


def test_what_changes_no_feature_is_a_twist_that_the_joints_can_make():
    rng = np.random.default_rng(5)
    L, J = rng.normal(size=(2, 6)), rng.normal(size=(6, 4))
    free = Inverse.through_joints(L, np.ones(2, bool), J).free
    np.testing.assert_allclose(L @ free, 0, atol=1e-12)
    np.testing.assert_allclose(free, J @ np.linalg.lstsq(J, free, rcond=None)[0], atol=1e-12)
    assert np.linalg.matrix_rank(free) == 2
    two = Inverse.through_joints(L, np.ones(2, bool), J[:, :2]).free
    np.testing.assert_allclose(two, 0, atol=1e-12)  # nothing is left of two joints


def test_a_component_of_weight_0_stands_in_secondary_tasks_too():
    rng = np.random.default_rng(6)
    weights = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
    inverse = Inverse.of(rng.normal(size=(2, 6)), np.ones(2, bool), np.ones(6, bool), weights)
    assert (inverse.free @ np.eye(6)[:, 3:5] == 0).all()
    assert np.abs(inverse.free[:, 0]).max() > 0.1


@pytest.mark.wide
@pytest.mark.parametrize("margin", [40.0, 80.0])
def test_two_joints_keep_the_view_by_twists_that_they_can_make(margin):
    """Twists of the other directions would do nothing, and the target left the view."""
    changes = ["motion.kind=still", "goal.x=100", "run.duration=3", "measure.after=1"]
    changes += ["controller.kind=qp", f"controller.margin={margin}", "expect={}"]
    steps, report = measured_run(load("scara_line", changes))
    assert report.outcome in (Outcome.CONVERGED, Outcome.TIMED_OUT)
    corners, camera = steps[-1].truth.corners, steps[-1].scene.camera
    room = min(corners.min(), (np.array([camera.width, camera.height]) - corners).min())
    assert room > margin - 1
