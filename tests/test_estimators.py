import numpy as np
import pytest

from servo.estimators import difference, kalman_ca, kalman_cv
from servo.estimators._kalman import between
from servo.estimators.difference import Difference
from servo.types import OwnMotion

RNG = np.random.default_rng(0)


def measurements(count=60):
    """Errors and own motions whose plain difference is a known series."""
    z = np.cumsum(RNG.normal(0, 0.02, (count, 4)), axis=0)
    own = RNG.normal(0, 0.1, (count, 4))
    errors = np.cumsum((z + own) / 30, axis=0)
    return z, own, errors


def test_difference_is_what_the_cameras_motion_does_not_explain():
    z, own, errors = measurements()
    estimator = difference.Config().build(RNG)
    assert estimator.update(errors[0], OwnMotion.of(own[0]), 1 / 30).motion.tolist() == [0, 0, 0, 0]
    for k in range(1, 10):
        np.testing.assert_allclose(
            estimator.update(errors[k], OwnMotion.of(own[k]), 1 / 30).motion, z[k], atol=1e-12
        )


def test_difference_of_angles_passes_the_wrap():
    estimator = Difference()
    estimator.measure(np.array([0, 0, 0, np.pi / 2 - 0.01]), np.zeros(4), 0.1)
    after = estimator.measure(np.array([0, 0, 0, -np.pi / 2 + 0.01]), np.zeros(4), 0.1)
    assert after[3] == pytest.approx(0.2)


def test_no_difference_spans_a_gap():
    estimator = Difference()
    estimator.measure(np.zeros(4), np.zeros(4), 0.1)
    estimator.measure(np.full(4, 0.01), np.zeros(4), 0.1)
    estimator.forget()
    np.testing.assert_allclose(estimator.value, 0.1)
    np.testing.assert_allclose(estimator.measure(np.full(4, 9.0), np.zeros(4), 0.1), 0.1)
    np.testing.assert_allclose(
        estimator.measure(np.full(4, 9.02), np.zeros(4), 0.1), 0.2, rtol=1e-9
    )


def test_kalman_agrees_with_the_textbook_written_out():
    z, own, errors = measurements()
    rho, sQ, sR = 0.5, 2e-4, 1e-3
    estimator = kalman_cv.Config(rho=rho, state_variance=sQ, measure_variance=sR).build(RNG)
    estimator.update(errors[0], OwnMotion.of(own[0]), 1 / 30)
    F, H, Q = np.array([[1, 1], [0, rho]]), np.array([[1.0, 0.0]]), np.diag([0, sQ])
    x, P = np.stack([z[1], np.zeros(4)]), np.diag([sR, sQ / (1 - rho**2)])
    np.testing.assert_allclose(
        estimator.update(errors[1], OwnMotion.of(own[1]), 1 / 30).motion, z[1], atol=1e-12
    )
    for k in range(2, 60):
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T / (H @ P @ H.T + sR)
        x, P = x + K @ (z[k] - H @ x), (np.eye(2) - K @ H) @ P
        np.testing.assert_allclose(
            estimator.update(errors[k], OwnMotion.of(own[k]), 1 / 30).motion, x[0], atol=1e-10
        )


def test_tuned_constants_pass_through_both_rates():
    assert between(0.03, 3.0, 1 / 30) == pytest.approx(0.03)
    assert between(0.03, 3.0, 1 / 5) == pytest.approx(3.0)
    assert 0.03 < between(0.03, 3.0, 1 / 15) < 3.0


def test_kalman_is_smoother_than_the_difference_and_follows_a_constant():
    rng = np.random.default_rng(1)
    noisy = 0.1 + rng.normal(0, 0.05, 400)
    errors = np.cumsum(noisy) / 30
    estimator = kalman_cv.Config().build(rng)
    found = [
        estimator.update(np.full(4, e), OwnMotion.of(np.zeros(4)), 1 / 30).motion[0] for e in errors
    ][50:]
    assert np.mean(found) == pytest.approx(0.1, abs=0.01)
    assert np.std(found) < 0.6 * 0.05


def test_kalman_with_acceleration_agrees_with_the_textbook_written_out():
    z, own, errors = measurements()
    rho, sQ, sA, sR, T = 0.4, 2e-4, 3e-4, 1e-3, 1 / 30
    estimator = kalman_ca.Config(
        rho=rho, state_variance=sQ, acceleration_variance=sA, measure_variance=sR
    ).build(RNG)
    estimator.update(errors[0], OwnMotion.of(own[0]), T)
    s = sQ / (1 - rho**2)
    F = np.array([[1, 1, T], [0, rho, 0], [0, 0, 1]])
    H, Q = np.array([[1.0, 0.0, 0.0]]), np.diag([0, sQ, sA])
    P = np.array(
        [[sR, 0, sR / T], [0, s, -rho * s / T], [sR / T, -rho * s / T, (2 * sR + s) / T**2]]
    )
    x = np.vstack([z[1], np.zeros((2, 4))])
    np.testing.assert_allclose(
        estimator.update(errors[1], OwnMotion.of(own[1]), T).motion, z[1], atol=1e-12
    )
    for k in range(2, 40):
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T / (H @ P @ H.T + sR)
        x, P = x + K @ (z[k] - H @ x), (np.eye(3) - K @ H) @ P
        np.testing.assert_allclose(
            estimator.update(errors[k], OwnMotion.of(own[k]), T).motion, x[0], atol=1e-8
        )
