"""A long run needs little more memory than a short one."""

import tracemalloc

import pytest

from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.run_measures import summarise
from servo.scenario.load import load

CHANGES = ["tracker.kind=truth", "run.duration=10", "controller.feed_forward=[]"]
LARGEST = 800
"""Of what stays of a step [bytes]: 12,000 of them have room in 10 MB."""


@pytest.fixture(scope="module")
def measured():
    """The columns of a run of 300 frames, its steps, and the memory that its last 200 took."""
    run = Columns()
    steps = []
    with Episode(load("line", CHANGES), seen=False) as episode:
        for step in episode:
            if step.frame.index == 100:
                tracemalloc.start()
                before = tracemalloc.get_traced_memory()[0]
            run.add(step)
            if step.frame.index < 100:
                steps.append(step)
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
    return run, steps, grown


@pytest.mark.wide
def test_little_stays_of_a_step(measured):
    run, _, grown = measured
    assert len(run) == 300
    assert grown < 200 * LARGEST + 32 * 10_000  # with the whole steps of the last second


def test_the_steps_of_the_last_second_are_kept_whole(measured):
    run, _, _ = measured
    times = [step.frame.time for step in run.final]
    assert 29 <= len(times) <= 31
    assert times[-1] == run["time"][-1]
    assert times[0] > times[-1] - 1.0
    assert run.first.frame.index == 0


def test_a_column_has_the_numbers_of_each_step(measured):
    run, steps, _ = measured
    assert run["servo"][:100].tolist() == [step.servo_error for step in steps]
    assert run["joints"].shape == (300, 6)
    assert run["corners"].shape == (300, 4, 2)
    assert run["corners"][99].tolist() == steps[99].truth.corners.tolist()
    assert not run["other_picture"][0]


def test_measures_of_columns_are_those_of_steps(measured):
    _, steps, _ = measured
    config = load("line").measure
    assert summarise(Columns.of(steps), config, 1 / 30) == summarise(steps, config, 1 / 30)


def test_steps_are_added_while_a_column_is_held(measured):
    _, steps, _ = measured
    run = Columns.of(steps[:2])
    held = run["time"]
    run.add(steps[2])
    assert held.tolist() == [0.0, 1 / 30]
    assert run["time"].tolist() == [0.0, 1 / 30, 2 / 30]
