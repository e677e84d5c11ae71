from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from servoing import METRIC, begun, own

from servo.estimators import difference, error_kalman, imm, integral, jump, kalman_ca, kalman_cv
from servo.estimators._difference_filters import between
from servo.estimators._error_filters import ErrorFilters
from servo.estimators.jump import Cusum
from servo.features.moments import NOISE
from servo.sight.difference import Difference
from servo.types import OwnMotion

RNG = np.random.default_rng(0)


def measurements(count=60):
    """Errors and own motions whose plain difference is a known series."""
    z = np.cumsum(RNG.normal(0, 0.02, (count, 4)), axis=0)
    given = RNG.normal(0, 0.1, (count, 4))
    errors = np.cumsum((z + given) / 30, axis=0)
    return z, given, errors


def test_difference_is_what_the_cameras_motion_does_not_explain():
    z, given, errors = measurements()
    estimator = begun(difference.Config().build(RNG))
    assert estimator.update(errors[0], own(given[0]), 1 / 30).motion.tolist() == [0, 0, 0, 0]
    for k in range(1, 10):
        np.testing.assert_allclose(
            estimator.update(errors[k], own(given[k]), 1 / 30).motion, z[k], atol=1e-12
        )


def test_difference_of_angles_passes_the_wrap():
    estimator = Difference(METRIC)
    estimator.measure(np.array([0, 0, 0, np.pi / 2 - 0.01]), np.zeros(4), 0.1)
    after, _ = estimator.measure(np.array([0, 0, 0, -np.pi / 2 + 0.01]), np.zeros(4), 0.1)
    assert after[3] == pytest.approx(0.2)


def test_the_integral_is_the_sum_of_the_errors_that_were_seen():
    estimator = begun(integral.Config(gain=2.0).build(RNG))
    own = OwnMotion(np.zeros(4), np.zeros((0, 4)))
    for error in (0.1, 0.3, np.nan):
        found = estimator.update(np.full(4, error), own, 0.5)
    np.testing.assert_allclose(found.motion, 2.0 * 0.5 * 0.4)
    np.testing.assert_allclose(estimator.skip(own, 0.5).motion, 0.4)


def test_no_difference_spans_a_gap():
    estimator = Difference(METRIC)
    estimator.measure(np.zeros(4), np.zeros(4), 0.1)
    estimator.measure(np.full(4, 0.01), np.zeros(4), 0.1)
    estimator.forget()
    np.testing.assert_allclose(estimator.value, 0.1)
    kept, fresh = estimator.measure(np.full(4, 9.0), np.zeros(4), 0.1)
    np.testing.assert_allclose(kept, 0.1)
    assert not fresh.any()
    found, fresh = estimator.measure(np.array([9.02, np.nan, 9.02, 9.02]), np.zeros(4), 0.1)
    np.testing.assert_allclose(found, [0.2, 0.1, 0.2, 0.2], rtol=1e-9)
    assert fresh.tolist() == [True, False, True, True]


def test_kalman_agrees_with_the_textbook_written_out():
    z, given, errors = measurements()
    rho, sQ, sR = 0.5, 2e-4, 1e-3
    estimator = begun(kalman_cv.Config(rho=rho, ratio=sQ / sR, noise="difference").build(RNG))
    estimator.update(errors[0], own(given[0]), 1 / 30)
    F, H, Q = np.array([[1, 1], [0, rho]]), np.array([[1.0, 0.0]]), np.diag([0, sQ])
    x, P = np.stack([z[1], np.zeros(4)]), np.diag([sR, sQ / (1 - rho**2)])
    np.testing.assert_allclose(
        estimator.update(errors[1], own(given[1]), 1 / 30).motion, z[1], atol=1e-12
    )
    for k in range(2, 60):
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T / (H @ P @ H.T + sR)
        x, P = x + K @ (z[k] - H @ x), (np.eye(2) - K @ H) @ P
        np.testing.assert_allclose(
            estimator.update(errors[k], own(given[k]), 1 / 30).motion, x[0], atol=1e-10
        )


def test_an_innovation_of_the_difference_has_the_units_of_the_error():
    estimator = begun(kalman_cv.Config(noise="difference").build(RNG))
    for error in (0.0, 0.0, 0.0, 0.2):
        found = estimator.update(np.full(4, error), OwnMotion(np.zeros(4), ()), 1 / 30)
    np.testing.assert_allclose(found.innovation, 0.2)


def test_tuned_constants_pass_through_both_rates():
    assert between(0.03, 3.0, 1 / 30) == pytest.approx(0.03)
    assert between(0.03, 3.0, 1 / 5) == pytest.approx(3.0)
    assert 0.03 < between(0.03, 3.0, 1 / 15) < 3.0


def test_kalman_is_smoother_than_the_difference_and_follows_a_constant():
    rng = np.random.default_rng(1)
    noisy = 0.1 + rng.normal(0, 0.05, 400)
    errors = np.cumsum(noisy) / 30
    estimator = begun(kalman_cv.Config().build(rng))
    found = [estimator.update(np.full(4, e), own(np.zeros(4)), 1 / 30).motion[0] for e in errors][
        50:
    ]
    assert np.mean(found) == pytest.approx(0.1, abs=0.01)
    assert np.std(found) < 0.6 * 0.05


def test_kalman_with_acceleration_agrees_with_the_textbook_written_out():
    z, given, errors = measurements()
    rho, sQ, sA, sR, T = 0.4, 2e-4, 3e-4, 1e-3, 1 / 30
    estimator = begun(
        begun(
            kalman_ca.Config(
                rho=rho, ratio=sQ / sR, acceleration_ratio=sA * T**2 / sR, noise="difference"
            ).build(RNG)
        )
    )
    estimator.update(errors[0], own(given[0]), T)
    s = sQ / (1 - rho**2)
    F = np.array([[1, 1, T], [0, rho, 0], [0, 0, 1]])
    H, Q = np.array([[1.0, 0.0, 0.0]]), np.diag([0, sQ, sA])
    P = np.array(
        [[sR, 0, sR / T], [0, s, -rho * s / T], [sR / T, -rho * s / T, (2 * sR + s) / T**2]]
    )
    x = np.vstack([z[1], np.zeros((2, 4))])
    np.testing.assert_allclose(
        estimator.update(errors[1], own(given[1]), T).motion, z[1], atol=1e-12
    )
    for k in range(2, 40):
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T / (H @ P @ H.T + sR)
        x, P = x + K @ (z[k] - H @ x), (np.eye(3) - K @ H) @ P
        np.testing.assert_allclose(
            estimator.update(errors[k], own(given[k]), T).motion, x[0], atol=1e-8
        )


def follow(estimator, speeds, dt=1 / 30, seed=0):
    """Predictions for a target whose speed per frame is given, measured with the usual noise."""
    rng, error, found = np.random.default_rng(seed), np.zeros(4), []
    for speed in speeds:
        error = error + dt * speed
        seen = error + rng.normal(0, NOISE)
        found.append(estimator.update(seen, own(np.zeros(4)), dt))
    return found


STEP = np.repeat([0.1, -0.1], 60)


def test_after_a_jump_cusum_begins_anew_and_the_plain_filter_lags():
    plain, watchful = (
        [o.motion[0] for o in follow(begun(kind.Config().build(RNG)), STEP)]
        for kind in (kalman_cv, jump)
    )
    assert abs(watchful[61] + 0.1) < 0.02
    assert abs(plain[61] + 0.1) > 0.03
    np.testing.assert_allclose(watchful[30:59], plain[30:59], atol=0.02)


def test_cusum_sums_what_passes_the_drift_in_either_direction():
    test = Cusum(drift=1.0, threshold=4.0)
    up = np.array([3.0, -3.0, 1.0, 0.0])
    assert test.jumped(up).tolist() == [False] * 4  # 2
    assert test.jumped(up).tolist() == [False] * 4  # 4
    assert test.jumped(up).tolist() == [True, True, False, False]  # 6
    assert test.jumped(up).tolist() == [False] * 4  # anew


@pytest.mark.parametrize("kind", [error_kalman, imm])
def test_filters_on_the_error_smooth_follow_and_predict_over_the_delay(kind):
    dt = 1 / 30
    predictions = follow(begun(kind.Config().build(RNG)), np.full(120, 0.1))
    motions = np.array([o.motion[0] for o in predictions[60:]])
    assert motions.mean() == pytest.approx(0.1, abs=2e-3)
    assert motions.std() < 0.5 * np.sqrt(2) * NOISE[0] / dt  # of the plain difference
    late, rest, steady = begun(kind.Config().build(RNG)), np.zeros(4), np.full(4, 0.1)
    coming = np.array([[-0.2] * 4, [0.3] * 4])
    for k in range(60):
        predicted = late.update(dt * k * steady, OwnMotion(rest, coming), dt)
    # Two intervals with the commands under way, and the target's own motion.
    expected = dt * (59 * 0.1 + (0.1 - 0.2) + (0.1 + 0.3))
    np.testing.assert_allclose(predicted.error, expected, atol=1e-4)


@pytest.mark.parametrize("kind", [error_kalman, imm])
def test_a_feature_that_was_never_measured_has_no_error_ahead(kind):
    estimator = begun(kind.Config().build(RNG))
    moving = OwnMotion(np.full(4, 0.5), np.full((2, 4), 0.5))
    seen = estimator.update(np.array([0.1, 0.1, np.nan, np.nan]), moving, 1 / 30)
    blind = estimator.skip(moving, 1 / 30)
    # Two frame intervals until the command acts, and a third one without a picture.
    np.testing.assert_allclose(seen.error, [0.1 + 1 / 30, 0.1 + 1 / 30, 0, 0], atol=1e-4)
    np.testing.assert_allclose(blind.error, [0.15, 0.15, 0, 0], atol=1e-4)
    assert seen.motion[2:].tolist() == blind.motion[2:].tolist() == [0, 0]


@pytest.mark.parametrize("kind", [error_kalman, imm])
def test_filters_on_the_error_know_what_the_camera_did(kind):
    estimator, dt = begun(kind.Config().build(RNG)), 1 / 30
    rng, error = np.random.default_rng(0), np.zeros(4)
    for _ in range(100):
        caused = rng.normal(0, 0.2, 4)
        error = error + dt * (caused + 0.1)
        predicted = estimator.update(error, own(caused), dt)
    np.testing.assert_allclose(predicted.motion, 0.1, atol=1e-3)


@pytest.mark.parametrize("kind", [error_kalman, imm])
def test_filters_on_the_error_pass_the_wrap_and_coast(kind):
    estimator, dt, rest = begun(kind.Config().build(RNG)), 1 / 30, own(np.zeros(4))
    for k in range(60):
        angle = 1.4 + 0.5 * dt * k
        wrapped = angle - np.pi if angle > np.pi / 2 else angle
        predicted = estimator.update(np.array([0, 0, 0, wrapped]), rest, dt)
    assert predicted.motion[3] == pytest.approx(0.5, abs=0.01)
    for _ in range(15):
        blind = estimator.skip(rest, dt)
    assert blind.error[3] - predicted.error[3] == pytest.approx(15 * dt * 0.5, abs=0.01)


def test_the_mixture_is_as_smooth_as_the_smooth_model_and_as_fast_as_the_other():
    def smooth_motion(dt, jump=0.0):
        model = error_kalman.motion(dt, jump)
        less = np.diag([1.0, 1e-3 / error_kalman.ACCELERATION_AT_30_HZ])
        return replace(model, Q=model.Q @ less, P=model.P @ less)

    filters = (
        ErrorFilters(smooth_motion, predicts=True),
        imm.Imm((smooth_motion, partial(smooth_motion, jump=imm.JUMP))),
    )
    smooth, mixed = ([o.motion[0] for o in follow(begun(f), STEP)] for f in filters)
    assert np.std(mixed[40:59]) < 3 * np.std(smooth[40:59])
    late_smooth, late_mixed = (np.linalg.norm(np.add(m[60:80], 0.1)) for m in (smooth, mixed))
    assert late_mixed < 0.6 * late_smooth


@pytest.mark.parametrize("kind", [kalman_cv, kalman_ca, jump, error_kalman, imm])
def test_innovations_over_their_variance_are_about_one_for_the_noise_they_expect(kind):
    predictions = follow(begun(kind.Config().build(RNG)), np.full(600, 0.05))
    nis = np.array([o.nis for o in predictions[100:]])
    assert np.all((nis.mean(axis=0) > 0.5) & (nis.mean(axis=0) < 2.0))
    innovations = np.array([o.innovation for o in predictions[100:]])
    assert np.all(np.abs(innovations.mean(axis=0)) < 0.2 * innovations.std(axis=0))
