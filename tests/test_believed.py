"""What a wrong calibration does, against the textbook's closed forms: corners are exact, nothing is
rendered, the camera moves freely.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np
import pytest
from dark import Dark

import servo.loop.episode
from servo.loop.episode import Episode
from servo.loop.run_measures import summarise
from servo.scenario.load import load
from sim.geometry import angle_of, exp_se3, log_se3
from tracking.types import Estimate, State, Status, unknown_covariance

F, DEPTH = 600.0, 1.0
"""Of the scenario `small_hybrid` [px, m]."""
TILTED = "start.pose=[0.15, -0.1, 1.3, 61.0606, 3.1128, 36.2191]"
SCHEMES = ("points", "pose", "hybrid")


@dataclass(frozen=True)
class Exact:
    """A tracker that reports the true corners of a world that it is given."""

    world: ClassVar = []

    def build(self, rng):
        return self

    def start(self, frame, region, state):
        pass

    def update(self, frame, ego=None):
        truth = self.world[-1].truth()
        state = State(*truth.centre.tolist(), truth.theta)
        return Estimate(state, unknown_covariance(), 0.0, Status.LOCKED, corners=truth.corners)


def exact(*changes):
    """An episode with exact corners, three to four times as fast as the textbook's."""
    quick = ("run.duration=3.2", "controller.gain=4.0", "world.drive_rate=25.0")
    return Episode(replace(load("small_hybrid", [*quick, *changes]), tracker=Exact()), Dark)


@cache
def run(*changes):
    """The steps of a run, without pictures, and its measures."""
    with exact(*changes) as episode:
        Exact.world.append(episode.world)
        steps = [step.light() for step in episode]
    return steps, summarise(steps, episode.scenario.measure, episode.world.period)


def end_of(*changes):
    """Where the target is in the camera at the end, against the goal [m], and the rotation left."""
    steps, _ = run(*changes)
    T_camera_object = steps[-1].T_object_camera.inverse()
    return T_camera_object.translation - [0, 0, DEPTH], angle_of(T_camera_object.rotation)


def test_where_nothing_is_wrong_the_loop_has_the_worlds_own_camera_and_posture():
    with exact() as episode:
        world, posture = episode.world, episode.world.posture()
        assert world.camera_believed is world.camera
        assert world.believed(posture) is posture


def test_a_twist_in_the_believed_camera_is_made_around_it():
    """A motion X of the believed camera is E X E^-1 of the true one, with E the hand-eye error."""
    changes = ("believed.hand_eye_rotation_deg=[20, -10, 40]", "believed.hand_eye_mm=[80, 0, -30]")
    with exact(*changes, TILTED) as episode:
        world, twist = episode.world, np.array([0.2, -0.1, 0.3, 0.4, -0.5, 0.6])
        E = episode.scenario.believed.hand_eye
        before, known = world.truth().T_world_camera, world.believed(world.posture())
        off = log_se3((before @ E).inverse() @ known.T_base_camera)
        assert np.abs(off).max() < 1e-9
        assert not world.step(twist)
        made = before @ E @ exp_se3(twist * world.period) @ E.inverse()
        off = log_se3(made.inverse() @ world.truth().T_world_camera)
        assert np.abs(off).max() < 1e-5
        np.testing.assert_allclose(world.believed(world.posture()).twist, twist, atol=1e-3)


@pytest.mark.parametrize("features", SCHEMES)
def test_a_wrong_hand_eye_pose_bends_the_way_and_not_its_end(features):
    """The loop closes over the camera: e = 0 is one place, whatever the robot takes it for."""
    kind = f"features.kind={features}"
    wrong = (
        "believed.hand_eye_rotation_deg=[0.0, 0.0, 30.0]",
        "believed.hand_eye_mm=[60.0, 0.0, 0.0]",
    )
    ways = []
    for changes in ((), wrong):
        steps, report = run(kind, TILTED, *changes)
        ways.append(np.array([s.T_object_camera.translation for s in steps]))
        assert report.measures["end_position_mm"] < 0.1
        assert report.measures["end_rotation_deg"] < 0.01
    assert np.linalg.norm(ways[0] - ways[1], axis=1).max() > 0.1


def test_four_features_end_with_the_tilt_of_a_turn_about_the_wrong_axis():
    """The camera turns by psi about an axis that is off by eps: 2 asin(sin(eps) sin(psi / 2))."""
    four = (
        "features.kind=moments",
        'controller.dof=["vx", "vy", "vz", "wz"]',
        "target.kind=car",
        "start.pose=[0.0, 0.0, 1.0, 0.0, 0.0, 60.0]",
    )
    steps, _ = run(*four, "believed.hand_eye_rotation_deg=[8.0, 0.0, 0.0]")
    turned = 2 * np.arcsin(np.sin(np.radians(8)) * np.sin(np.radians(30)))
    assert np.abs(steps[-1].error).max() < 1e-4
    assert steps[-1].tilt == pytest.approx(turned, rel=0.02)


@pytest.mark.parametrize("features", ["points", "pose"])
@pytest.mark.parametrize(
    ("wrong", "goal", "end"),
    [
        ("fx_factor=1.1", "computed", (0.0, 0.0, 1 / 1.1 - 1)),
        ("fx_factor=1.1", "pose", (0.0, 0.0, 1 / 1.1 - 1)),
        ("fx_factor=1.1", "shown", (0.0, 0.0, 0.0)),
        ("cx_shift=20.0", "computed", (0.0, 0.0, 0.0)),
        ("cy_shift=-30.0", "pose", (0.0, -30 / F, 0.0)),
        ("cx_shift=20.0", "shown", (0.0, 0.0, 0.0)),
    ],
)
def test_wrong_intrinsics_leave_what_the_goal_is_wrong_by(features, wrong, goal, end):
    """A computed goal has its centre in pixels, which no camera changes, and its size f / Z; a goal
    that is a pose ends where the wrong camera measures it; a shown one is right.
    """
    changes = f"features.kind={features}", f"believed.{wrong}", f"believed.goal={goal}"
    off, turned = end_of(*changes)
    np.testing.assert_allclose(off, np.multiply(end, DEPTH), atol=1e-4)
    measured = run(*changes)[1].measures["end_position_mm"]
    assert measured == pytest.approx(1e3 * DEPTH * np.linalg.norm(end), abs=0.1)
    assert np.degrees(turned) < 0.02


@pytest.mark.parametrize("features", SCHEMES)
def test_a_target_taken_for_larger_ends_every_scheme_nearer(features, monkeypatch):
    """Its size makes the goal's picture as well as the measured pose: Z = Z* / factor."""
    loop = servo.loop.episode.Loop
    monkeypatch.setattr(servo.loop.episode, "Loop", lambda s, c, o, t: loop(s, c, 1.1 * o, t))
    run.cache_clear()
    off, _ = end_of(f"features.kind={features}")
    run.cache_clear()
    np.testing.assert_allclose(off, [0.0, 0.0, 1 / 1.1 - 1], atol=1e-4)


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_wrong_depth_is_a_gain_that_is_wrong_by_as_much(factor):
    """The error shrinks by 1 - lambda T factor a frame."""
    four = (
        "features.kind=moments",
        'controller.dof=["vx", "vy", "vz"]',
        "target.kind=car",
        "start.pose=[0.05, 0.03, 1.0, 0.0, 0.0, 0.0]",
    )
    steps, _ = run(*four, f"believed.depth_factor={factor}", "controller.gain=1.0")
    errors = [float(np.hypot(*s.error[:2])) for s in steps[2:42]]
    assert (errors[-1] / errors[0]) ** (1 / 39) == pytest.approx(1 - factor / 25, abs=1e-3)


@pytest.mark.wide
@pytest.mark.parametrize("features", SCHEMES)
def test_an_ignored_distortion_changes_the_depth_by_what_it_does_to_the_corners(features):
    """Corners at r are seen at r (1 + k r^2), and have to be where a pinhole sees them at 0.1 m."""
    lens = ("camera.distortion=plumb_bob", "camera.coefficients=[-0.3, 0.0, 0.0, 0.0, 0.0]")
    off, turned = end_of(f"features.kind={features}", *lens, "believed.ignore_distortion=true")
    assert off[2] == pytest.approx(-0.3 * 2 * 0.1**2, rel=0.02)
    assert np.degrees(turned) < 0.02
