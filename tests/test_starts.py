"""A part that is started again remembers nothing of the task before."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from servoing import CAMERA, OUTLINE, begun, own, posture_of

from servo import controllers, estimators, features
from servo.parts import Task
from servo.testing._examples import DOWN, FIRST, film, region_of, seen_from
from sim.channels import Channel, needs_of
from sim.geometry import exp_se3
from sim.types import Pose
from tracking import trackers
from tracking.types import Region

TRACKERS = [
    kind for kind in trackers.KINDS.names() if kind not in ("program", "tag", "trax", "truth")
]
STILL = posture_of(np.zeros(6))
GOAL = Pose.planar(0.0, 0.0, 0.0)


def twice(config, task):
    """What a part does in a task: built anew, and after another start with the same draws."""
    rng = np.random.default_rng(0)
    part = config.build(rng)
    draws = copy.deepcopy(rng.bit_generator.state)
    first = task(part)
    rng.bit_generator.state = draws
    return first, task(part)


@pytest.mark.parametrize("kind", TRACKERS)
def test_a_tracker_that_is_started_again(kind):
    def task(tracker):
        first, *others = film(8, gone_after=6)
        tracker.start(first, region_of(None), FIRST)
        return [(e.state, e.distance, e.status) for e in map(tracker.update, others)]

    fresh, again = twice(trackers.KINDS.config_of(kind)(), task)
    assert fresh == again


@pytest.mark.parametrize("kind", sorted({*TRACKERS} - {"recorded"}))
def test_a_scale_at_the_start_is_another_unit_of_size(kind):
    def track(scale):
        tracker = trackers.KINDS.config_of(kind)().build(np.random.default_rng(0))
        first, *others = film(5)
        whole = region_of(None)
        region = Region(whole.width / scale, whole.height / scale)
        tracker.start(first, region, replace(FIRST, scale=FIRST.scale * scale))
        # The target jumps by more than its size, is gone, and appears elsewhere.
        jumped = [replace(f, image=np.roll(f.image, (30, 60), (0, 1))) for f in others]
        gone = [replace(f, image=np.full_like(f.image, 90)) for f in others]
        found = map(tracker.update, [*others, *jumped, *gone, *others])
        return [(e.state.x, e.state.y, e.state.theta, e.state.scale / scale) for e in found]

    np.testing.assert_allclose(track(2.0), track(1.0), atol=1e-6)


@pytest.mark.parametrize("kind", estimators.KINDS.names())
def test_an_estimator_that_is_started_again(kind):
    def task(estimator):
        begun(estimator)
        noise = np.random.default_rng(1)
        rest = own(np.zeros(4))
        estimator.skip(rest, 0.1)
        errors = [0.002 * i**2 + noise.normal(0, 1e-4, 4) for i in range(25)]
        found = [estimator.update(error, rest, 0.1) for error in errors]
        return np.array([(p.error, p.motion, p.innovation, p.nis) for p in found])

    fresh, again = twice(estimators.KINDS.config_of(kind)(), task)
    np.testing.assert_array_equal(fresh, again)


@pytest.mark.parametrize(
    "kind", [k for k in controllers.KINDS.names() if k not in ("onnx", "program")]
)
@pytest.mark.parametrize("six", [False, True])
def test_a_controller_that_is_started_again(kind, six):
    tilted = exp_se3(np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0]))
    given = {"smooth_start": 2.0, "acceleration": 0.5, "secondary": ("level",)}
    settings = {} if kind in {"hold", "broyden"} else given
    leaning = replace(STILL, T_base_camera=DOWN @ tilted)

    def task(controller):
        found = features.KINDS.config_of("points" if six else "moments")().build(OUTLINE)
        estimator = begun(estimators.KINDS.config_of("none")().build(None), found)
        goal = seen_from(DOWN, GOAL, pixels=False)
        controller.start(Task(goal, found, estimator, CAMERA, OUTLINE, 2))
        seen = seen_from(DOWN, tilted @ Pose.planar(0.05, 0.02, 0.3), pixels=False)
        sights = (None, seen, seen, *[None] * 12, seen)
        return np.array([controller.command(sight, leaning, 0.1).twist for sight in sights])

    fresh, again = twice(controllers.KINDS.config_of(kind)(**settings), task)
    np.testing.assert_array_equal(fresh, again)


@pytest.mark.parametrize("kind", features.KINDS.names())
def test_features_that_are_asked_about_another_task_between(kind):
    config = features.KINDS.config_of(kind)()
    found = config.build(OUTLINE)
    pixels = Channel.PICTURE in needs_of(config)
    sight = seen_from(DOWN, Pose.planar(0.02, 0.01, 0.1), pixels=pixels)
    higher = Pose(DOWN.rotation, np.array([0.0, 0.0, 1.2]))
    other = seen_from(higher, GOAL, pixels=pixels)
    first = found.values(sight)
    found.values(other.goal)
    found.values(other)
    np.testing.assert_array_equal(found.values(sight), first)


def test_an_appearance_lies_where_its_state_says():
    white = np.full((60, 120, 3), 255, np.uint8)
    for k, frame in enumerate(film(3, picture=white)):
        rows, columns = np.nonzero(frame.image.min(axis=2) == 255)
        # Indices of pixels: the first one's middle is at 0.
        middle = (columns.mean() + 0.5, rows.mean() + 0.5)
        assert middle == pytest.approx((FIRST.x + k, FIRST.y), abs=0.1)
