"""A target without a direction: trackers say that they do not follow its angle, the loop leaves it
alone, and the outcome judges what is servoed.
"""

import functools
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

import servo
from servo.loop.run_measures import Outcome, summarise
from servo.mistake import Mistake
from sim.types import Frame
from tracking import create
from tracking.search.newton import shows_angle
from tracking.trackers import KINDS
from tracking.types import Region, State

TURNING = ("pf_ssd", "mk_ssd", "mk_pf", "kernel_pf")
"""Trackers of our own that follow the angle of their histograms."""
SIZE = (48, 48)


@functools.cache
def ground():
    rough = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 1, (240, 320, 3)), (0, 0), 6)
    return np.clip(150 + 60 * rough / rough.std(), 0, 255).astype(np.uint8)


def seen(shape, x=160, y=120):
    """The picture of a plain target on a rough ground, and its region."""
    image = ground().copy()
    colour = (30, 60, 160)
    width, height = (72, 36) if shape == "bar" else SIZE
    if shape == "bar":
        cv2.rectangle(image, (x - 36, y - 18), (x + 35, y + 17), colour, -1)
    else:
        cv2.circle(image, (x, y), 24, colour, -1)
    if shape == "halved":
        cv2.ellipse(image, (x, y), (24, 24), 0, 0, 180, (200, 60, 60), -1)
    return image, Region(width, height), State(float(x), float(y), 0.3 if shape == "disc" else 0.0)


@pytest.mark.parametrize(("shape", "shows"), [("disc", False), ("halved", True), ("bar", True)])
def test_a_target_shows_an_angle_if_it_looks_different_when_it_is_turned(shape, shows):
    assert shows_angle(*seen(shape)) is shows


def test_where_nothing_is_seen_nothing_is_said_against_an_angle():
    grey = np.full((240, 320, 3), 90, np.uint8)
    assert shows_angle(grey, Region(60.0, 30.0), State(160.0, 120.0))


@pytest.mark.parametrize("kind", TURNING)
@pytest.mark.parametrize("shape", ["disc", "halved"])
def test_the_angle_of_a_disc_stays_as_it_began(kind, shape):
    image, region, state = seen(shape)
    tracker = create(kind, seed=1)
    tracker.start(Frame(image, 0.0, 0), region, state)
    for i in range(1, 40):
        found = tracker.update(Frame(seen(shape, 160 + i, 120)[0], i / 30, i))
    assert found.follows == (shape == "halved", True)
    if shape == "disc":
        assert abs(found.state.x - 199) < 3.0
        assert found.state.theta == pytest.approx(0.3, abs=1e-9)
        if not np.isnan(found.covariance[0, 0]):
            assert np.isnan(found.covariance[2]).all()


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """An OBJ file of a flat disc."""
    at = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    rim = np.column_stack([np.cos(at), np.sin(at)]) * 0.05
    points = [(0, 0, 0.02), *((x, y, z) for z in (0.02, 0.0) for x, y in rim)]
    faces = []
    for i in range(48):
        j = (i + 1) % 48
        faces += [(1, 2 + i, 2 + j), (2 + i, 50 + i, 50 + j), (2 + i, 50 + j, 2 + j)]
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces]
    path = tmp_path_factory.mktemp("disc") / "disc.obj"
    path.write_text("\n".join(lines))
    return path


def circle_over(disc, *changes):
    """A run over a disc that turns once in 9 s while it drives, its rectangle longer than wide."""
    parts = [
        "target.kind=mesh",
        f"target.file={disc}",
        "target.size=0.1",
        "target.outline=[0.114, 0.1, 0.02]",
    ]
    scenario = servo.load("circle", [*parts, "run.duration=4", *changes])
    steps = [step.light() for step in servo.run(scenario)]
    return steps, summarise(steps, scenario.measure, 1 / scenario.camera.rate)


def test_the_camera_does_not_turn_with_an_angle_that_nobody_sees(disc):
    steps, summary = circle_over(disc)
    assert {s.estimate.follows for s in steps[2:]} == {(False, True)}
    assert not any(s.servoed[0] for s in steps)
    turns = [s.posture.T_base_camera.rotation[1, 0] for s in steps]
    assert np.ptp(turns) < 0.02
    assert summary.outcome is Outcome.CONVERGED


def test_features_that_need_the_angle_are_refused_in_one_sentence(disc):
    with pytest.raises(
        Mistake, match="the tracker follows no angle of this target, and without it"
    ):
        circle_over(disc, "features.kind=points", "controller.feed_forward=[]")


@dataclass(frozen=True)
class Drifting:
    """pf_ssd, whose angle drifts."""

    def build(self, rng):
        inner = KINDS.config("pf_ssd").build(rng)
        found = inner.update

        def update(frame, ego=None):
            seen = found(frame, ego)
            turned = replace(seen.state, theta=seen.state.theta + 0.4 * frame.time)
            return replace(seen, state=turned)

        inner.update = update
        return inner


def test_an_angle_that_is_wrong_is_no_convergence():
    """The camera turns with the drift, and holds the centre alone."""
    scenario = servo.load("line", ["run.duration=2.5"], tracker=Drifting())
    steps = [step.light() for step in servo.run(scenario)]
    summary = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    assert summary.measures["servo_angle_peak_deg"] > 20
    assert max(s.servo_error for s in steps[-30:]) < 10
    assert summary.outcome is Outcome.TIMED_OUT
