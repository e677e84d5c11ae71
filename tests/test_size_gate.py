"""A target's size cannot change faster than it comes or goes: a box that slips is not LOCKED."""

import numpy as np
import pytest

import servo
from tracking.search.size_gate import MOST_RATE, SPAN, SizeGate
from tracking.types import State, Status

FASTEST = MOST_RATE * SPAN
"""Largest change of ln scale within the span."""


def sized(log_scale):
    return State(50.0, 40.0, 0.0, float(np.exp(log_scale)))


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_limit_holds_for_growing_and_shrinking(sign):
    gate = SizeGate(sized(0.0), 0.0)
    assert gate.allows(sized(sign * 0.999 * FASTEST), 1 / 30)
    assert not gate.allows(sized(sign * 1.001 * FASTEST), 1 / 30)


def test_a_steady_approach_below_the_limit_is_allowed_for_ever():
    gate = SizeGate(sized(0.0), 0.0)
    for picture in range(1, 90):
        state, time = sized(0.95 * MOST_RATE * picture / 30), picture / 30
        assert gate.allows(state, time)
        gate.learn(state, time)


def test_steps_below_the_limit_add_up():
    gate = SizeGate(sized(0.0), 0.0)
    allowed = []
    for picture in range(1, 20):
        state, time = sized(-0.06 * picture), picture / 30
        allowed.append(gate.allows(state, time))
        if allowed[-1]:
            gate.learn(state, time)
    assert allowed.index(False) == 6  # 7 * 0.06 > FASTEST = 0.4


def test_after_a_time_without_the_target_its_size_is_free():
    gate = SizeGate(sized(0.0), 0.0)
    assert not gate.allows(sized(-1.0), 0.5)
    assert gate.allows(sized(-1.0), 0.76)


@pytest.fixture(scope="module")
def prism(tmp_path_factory):
    """An upright prism over a right triangle: half of its region is the table."""
    base = ((0, 0), (0.18, 0), (0, 0.09))
    lines = [f"v {x} {y} {z}" for z in (0, 0.06) for x, y in base]
    lines += ["f 1 3 2", "f 4 5 6", "f 1 2 5 4", "f 2 3 6 5", "f 3 1 4 6"]
    path = tmp_path_factory.mktemp("prism") / "prism.obj"
    path.write_text("\n".join(lines))
    return ["target.kind=mesh", f"target.file={path}", "target.size=0.18", "run.duration=1.3"]


@pytest.mark.parametrize("tracker", ["pf_ssd", "mk_ssd"])
def test_a_box_that_slips_into_a_corner_is_not_locked(prism, tracker):
    """It was LOCKED with a seventeenth of the target's size, and 3 degrees and 10 % stated."""
    settings = [*prism, f"tracker.kind={tracker}"]
    steps = list(servo.run(servo.load("circle", settings, seed=3)))[1:]
    seen = [step for step in steps if step.estimate.status is Status.LOCKED]
    assert 4 <= len(seen) < len(steps)
    sizes = [step.estimate.state.scale / step.true_state_estimated.scale for step in seen]
    assert min(sizes) > 0.2
