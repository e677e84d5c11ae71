"""What an estimator measured of a target that is hidden now is taken back."""

import numpy as np
import pytest
from servoing import begun, own

import servo
from servo.estimators import error_kalman, imm, jump, kalman_ca, kalman_cv
from servo.estimators._error_filters import ErrorFilters
from sim.channels import View

KINDS = [error_kalman, imm, jump, kalman_ca, kalman_cv]
DT = 1 / 30
HIDDEN = View(seen=False)


def followed(kind, frames):
    """An estimator that has seen a target which drives at 0.3 /s."""
    estimator = begun(kind.Config().build(np.random.default_rng(0)))
    for k in range(frames):
        estimator.update(np.full(4, 0.01 * k), own(np.full(4, 0.1)), DT)
    return estimator


@pytest.mark.parametrize("kind", KINDS)
def test_a_measurement_that_is_taken_back_is_a_frame_that_was_skipped(kind):
    caused = own(np.full(4, 0.2))
    takes_back, skips = followed(kind, 20), followed(kind, 20)
    takes_back.update(np.full(4, 0.25), caused, DT)
    takes_back.see(HIDDEN)
    skips.skip(caused, DT)
    for _ in range(3):
        one, other = takes_back.skip(caused, DT), skips.skip(caused, DT)
        np.testing.assert_allclose(one.motion, other.motion, atol=1e-9)
        np.testing.assert_allclose(one.error, other.error, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_else_is_taken_back(kind):
    """Not the first measurement, not a second one, and none from before a skipped frame."""
    caused = own(np.full(4, 0.2))
    early = begun(kind.Config().build(np.random.default_rng(0)))
    early.see(HIDDEN)
    early.update(np.full(4, 0.3), caused, DT)
    early.see(HIDDEN)
    kept = early.update(np.full(4, 0.3), caused, DT).innovation
    np.testing.assert_allclose(kept, -0.2 * DT, rtol=1e-6)  # the first is all but certain
    again, once = followed(kind, 20), followed(kind, 20)
    for _ in range(2):
        again.see(HIDDEN)
    once.see(HIDDEN)
    np.testing.assert_array_equal(*(e.skip(caused, DT).motion for e in (again, once)))
    late, plain = followed(kind, 20), followed(kind, 20)
    for estimator in (late, plain):
        estimator.skip(caused, DT)
    late.see(HIDDEN)
    np.testing.assert_array_equal(*(e.skip(caused, DT).motion for e in (late, plain)))


@pytest.mark.wide
def test_the_camera_does_not_drive_off_with_a_target_that_a_board_begins_to_hide():
    """It drove 14 px off by an estimate that the board had moved by 1.2 px, too little to doubt."""
    record = servo.simulate("occlusion_partial", ["run.duration=6"], seed=26).record
    assert record.measures["servo_peak_px"] < 2.0


def test_a_dropped_picture_takes_nothing_back(monkeypatch):
    """Nothing hides the target: it was whole in the picture before."""
    told = []
    monkeypatch.setattr(ErrorFilters, "see", lambda _, view: told.append(view.seen))
    run = servo.simulate("dropped_frames", ["run.duration=3"], seed=0)
    assert sum(not step.frame.fresh for step in run) > 10
    assert all(step.seen for step in run if step.frame.fresh)
    assert {*told} == {True, None}
