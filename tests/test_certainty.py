"""What a tracker states, and what is servoed of it: uncertain parts are left out, and a line says so."""

import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import servo
from servo.cli import run_command
from servo.loop.columns import Columns
from servo.loop.events import remarks_on_tracker
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from sim.types import Camera
from tracking.types import Estimate, Region, State, Status

REGION = Region(60.0, 30.0)
SIZE = np.sqrt(1800.0)
OUTLINE = np.array([[-0.1, -0.05, 0], [0.1, -0.05, 0], [0.1, 0.05, 0], [-0.1, 0.05, 0]])


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """A plain upright block: seen from the side, its one colour is larger than its region."""
    corners = list(itertools.product((-0.05, 0.05), (-0.03, 0.03), (0.0, 0.15)))
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += [f"f {' '.join(map(str, face))}" for face in faces]
    path = tmp_path_factory.mktemp("block") / "block.obj"
    path.write_text("\n".join(lines))
    return ["target.kind=mesh", f"target.file={path}", "target.size=0.15"]


def angle_errors(steps):
    found = [s.estimate.state.theta - s.true_state_estimated.theta for s in steps]
    return np.angle(np.exp(1j * np.array(found)))


def test_a_region_that_slips_inside_one_colour_turns_no_camera(block):
    """Its angle was 80 degrees off while 4 to 7 were stated, and the camera turned after it."""
    steps = list(servo.run(servo.load("circle", [*block, "run.duration=2"])))[1:]
    assert {step.estimate.status for step in steps} == {Status.LOCKED}
    assert max(step.tracking_error for step in steps) < 3.0
    assert np.degrees(np.abs(angle_errors(steps))).max() < 15.0
    variances = np.array([step.estimate.covariance[2, 2] for step in steps])
    left_out = variances > np.radians(20.0) ** 2
    assert left_out.sum() > 10
    assert (
        max(abs(s.command.twist[5]) for s, out in zip(steps, left_out, strict=True) if out) < 1e-6
    )
    assert f"{left_out.sum()} angles" in remarks_on_tracker(Columns.of(steps))


def test_a_run_says_so_once_and_so_does_its_report(block, tmp_path, capsys):
    settings = [*block, "run.duration=0.7"]
    run_command.run("circle", settings, None, tmp_path / "run", quiet=False, no_rerun=True)
    printed = " ".join(capsys.readouterr().out.split())
    told = json.loads((tmp_path / "run" / "report.json").read_text())["uncertain"]
    assert re.fullmatch(
        r"Of 21 pictures in which the tracker saw the target, it stated "
        r"\d+ angles, \d+ sizes too uncertainly to be servoed",
        told,
    )
    assert printed.count(told) == 1


def seen(deviations, follows=(True, True)):
    camera = Camera(290.0, 290.0, 160.0, 120.0, 320, 240)
    to_sight = EstimateToSight(SightConfig(), camera, REGION, OUTLINE)
    covariance = np.diag(np.array(deviations, float) ** 2)
    estimate = Estimate(State(160.0, 120.0), covariance, 0.0, Status.LOCKED, follows)
    sight = to_sight.see(estimate, None)
    return sight and (sight.angle_known, sight.size_known)


@pytest.mark.parametrize(
    ("deviations", "known"),
    [
        ([0.49 * SIZE, 0.49 * SIZE, np.radians(19.9), 0.249], (True, True)),
        ([0.0, 0.0, np.radians(20.1), 0.0], (False, True)),
        ([0.0, 0.0, 0.0, 0.251], (True, False)),
        ([0.51 * SIZE, 0.0, 0.0, 0.0], None),
        ([0.0, 0.51 * SIZE, 0.0, 0.0], None),
        ([np.nan] * 4, (True, True)),
    ],
)
def test_each_part_has_its_largest_standard_deviation(deviations, known):
    assert seen(deviations) == known


def test_what_is_not_followed_stays_unknown():
    assert seen([0.0] * 4, (False, True)) == (False, True)
    assert seen([0.0] * 4, (True, False)) == (True, False)


@pytest.mark.parametrize(("tracker", "least"), [("pf_ssd", 0.004), ("mk_ssd", 0.004)])
def test_errors_are_those_that_the_tracker_states(tracker, least):
    """NEES: 1 on average where what is stated is right (tests/benchmarks/nees.py has all trackers);
    the particles of `pf_ssd` alone have 0.003 for the angle in it.
    """
    settings = [f"tracker.kind={tracker}", "run.duration=2"]
    steps = list(servo.run(servo.load("line", settings)))[1:]
    errors = np.array([s.estimate.state.vector - s.true_state_estimated.vector for s in steps])
    stated = np.array([np.diagonal(s.estimate.covariance) for s in steps])
    nees = (errors**2 / stated).mean(axis=0)
    assert (nees > least).all()
    assert (nees < 2.0).all()


def test_nothing_is_said_where_all_is_certain():
    steps = list(servo.run(servo.load("still", ["run.duration=0.3"])))
    assert remarks_on_tracker(Columns.of(steps)) == ""


def test_centres_that_are_too_uncertain_are_counted():
    steps = list(servo.run(servo.load("still", ["run.duration=0.7"])))
    wide = np.diag([200.0**2, 0.1, 0.0, 0.0])
    for k in (3, 5, 6):
        steps[k] = replace(steps[k], estimate=replace(steps[k].estimate, covariance=wide))
    seen = sum(step.estimate.status == Status.LOCKED for step in steps if step.decided)
    assert remarks_on_tracker(Columns.of(steps)) == (
        f"Of {seen} pictures in which the tracker saw the target, it stated 3 centres too "
        "uncertainly to be servoed"
    )
