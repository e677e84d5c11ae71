"""The compiled kernels and their descent, against the same formulas in plain NumPy."""

import numpy as np
import pytest

from tracking.hot import descent
from tracking.hot import kernel_histograms as hot

RNG = np.random.default_rng(5)


def histogram_twin(image, state, half, centres, span, levels, stride):
    (half_width, half_height), (span_x, span_y) = half, span
    x, y, theta, log_scale = state
    scale, c, s = np.exp(log_scale), np.cos(theta), np.sin(theta)
    rows = np.arange(image.shape[0])
    columns = np.arange(image.shape[1])
    reach_x = scale * (abs(c) * half_width + abs(s) * half_height) + 1
    reach_y = scale * (abs(s) * half_width + abs(c) * half_height) + 1
    first_i, first_j = max(0, int(y - reach_y)), max(0, int(x - reach_x))
    rows, columns = rows[first_i::stride], columns[first_j::stride]
    j, i = np.meshgrid(columns, rows)
    dx, dy = j + 0.5 - x, i + 0.5 - y
    rx, ry = (c * dx + s * dy) / scale, (-s * dx + c * dy) / scale
    cover_x = np.clip(scale * (half_width - abs(rx)) + 0.5, 0, 1)
    cover_y = np.clip(scale * (half_height - abs(ry)) + 0.5, 0, 1)
    level = np.clip((image[i, j] + 0.5) * levels / 256 - 0.5, 0, levels - 1)
    low = np.minimum(level.astype(int), levels - 2)
    part = level - low
    sums = np.zeros((len(centres), levels**3))
    for k, centre in enumerate(centres):
        kernel = 1 - ((rx - centre[0]) / span_x) ** 2 - ((ry - centre[1]) / span_y) ** 2
        weight = np.maximum(kernel, 0) * cover_x * cover_y
        # Tetrahedra of the cube of bins: one corner after the other, the largest fraction first.
        order = np.argsort(-part, axis=-1, kind="stable")
        sorted_part = np.take_along_axis(part, order, axis=-1)
        steps = levels ** (2 - order)
        bins = low @ np.array([levels**2, levels, 1])
        left = np.concatenate([np.ones((*bins.shape, 1)), sorted_part], axis=-1)
        right = np.concatenate([sorted_part, np.zeros((*bins.shape, 1))], axis=-1)
        for corner in range(4):
            np.add.at(sums[k], bins, (left - right)[..., corner] * weight)
            if corner < 3:
                bins = bins + steps[..., corner]
    return sums


CASES = [
    (np.array([80.0, 60.0, 0.0, 0.0]), 1),
    (np.array([83.3, 55.1, 0.7, 0.2]), 1),
    (np.array([6.0, 4.0, -2.0, -0.3]), 1),
    (np.array([83.3, 55.1, 0.7, 0.2]), 2),
]
SHAPE = ((25.0, 15.0), np.array([[-16.0, -10.0], [0.0, 0.0], [16.0, 10.0]]), (18.0, 11.0), 8)


@pytest.mark.parametrize(("state", "stride"), CASES)
def test_kernel_histograms_agree_with_numpy(smooth_image, state, stride):
    sums, totals = hot.kernel_histograms(smooth_image, state, *SHAPE, stride)
    twin = histogram_twin(smooth_image, state, *SHAPE, stride)
    np.testing.assert_allclose(sums[:, :, 0], twin, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(totals[:, 0], twin.sum(axis=1), rtol=1e-12)


@pytest.mark.parametrize(("state", "step"), [(CASES[0][0], 1e-6), (CASES[1][0], 1e-6)])
def test_kernel_histogram_derivatives_agree_with_finite_differences(smooth_image, state, step):
    state = state + [0.123, 0.217, 0.05, 0.03]  # away from where a pixel's coverage has its kinks
    sums, totals = hot.kernel_histograms(smooth_image, state, *SHAPE, 1)
    for p in range(4):
        d = step * np.eye(4)[p]
        forward, f_total = hot.kernel_histograms(smooth_image, state + d, *SHAPE, 1)
        back, b_total = hot.kernel_histograms(smooth_image, state - d, *SHAPE, 1)
        difference = (forward[:, :, 0] - back[:, :, 0]) / (2 * step)
        error = np.linalg.norm(sums[:, :, 1 + p] - difference) / np.linalg.norm(difference)
        assert error < 1e-6, p
        np.testing.assert_allclose(
            totals[:, 1 + p], (f_total[:, 0] - b_total[:, 0]) / (2 * step), rtol=1e-6, atol=1e-5
        )


def test_normal_equations_agree_with_numpy():
    sums = RNG.random((3, 8, 5)) - 0.3
    sums[:, :, 0] = np.abs(sums[:, :, 0])
    sums[0, 2] = 0.0
    totals = sums.sum(axis=1)
    root, floor = np.sqrt(RNG.dirichlet(np.ones(8), 3)), 1e-3
    q = sums[:, :, 0] / totals[:, :1]
    dq = (sums[:, :, 1:] - q[:, :, None] * totals[:, None, 1:]) / totals[:, :1, None]
    dq[0, 2] = 0.0
    e = (np.sqrt(q + floor) - root).ravel()
    J = (dq / (2 * np.sqrt(q + floor))[:, :, None]).reshape(-1, 4)
    cost, gradient, curvature = descent.ssd_normal_equations(sums, totals, root, floor)
    assert cost == pytest.approx(e @ e / 3, rel=1e-13)
    np.testing.assert_allclose(gradient, J.T @ e / 3, rtol=1e-12)
    np.testing.assert_allclose(curvature, J.T @ J / 3, rtol=1e-12)


def test_a_damped_step_agrees_with_numpy():
    rows = RNG.normal(0, 1, (12, 4))
    H, g = rows.T @ rows, RNG.normal(0, 1, 4)
    units = np.array([1.0, 1.0, 0.05, 0.05])
    scaled = H * np.outer(units, units)
    scaled[np.diag_indices(4)] += 0.3 * np.trace(scaled) / 4
    expected = -units * np.linalg.solve(scaled, units * g)
    np.testing.assert_allclose(descent.damped_step(g, H, 0.3, units), expected, rtol=1e-12)


def descend_twin(image, x, kernels, roots, units, most, tolerance, hopeless):
    cost, g, H = descent.linearise(image, x, kernels, roots)
    damping, evaluations = descent.FIRST_DAMPING, 1
    while cost <= hopeless and evaluations < most and damping < descent.MOST_DAMPING:
        step = descent.damped_step(g, H, damping, units)
        if np.abs(step / units).max() < tolerance:
            return x + step, cost, evaluations
        there = descent.linearise(image, x + step, kernels, roots)
        evaluations += 1
        if there[0] < cost:
            x, damping, (cost, g, H) = x + step, damping * descent.LESS, there
        else:
            damping *= descent.MORE
    return x, cost, evaluations


@pytest.mark.parametrize(
    ("most", "tolerance", "hopeless"),
    [(8, 0.2, 2.0), (30, 0.0, 2.0), (3, 0.0, 2.0), (8, 0.2, 1e-3)],
    ids=["until the step is short", "until no step is better", "cut off", "hopeless"],
)
def test_a_descent_agrees_with_python(smooth_image, most, tolerance, hopeless):
    *parts, levels = SHAPE
    true, units = np.array([60.0, 45.0, 0.2, 0.0]), np.array([1.0, 1.0, 0.05, 0.05])
    kernels = (*parts, levels, 2000)
    sums, totals = descent.histograms(smooth_image, true, kernels)
    roots = np.sqrt(sums[:, :, 0] / totals[:, :1] + descent.FLOOR)
    start = true + [3.0, -2.0, 0.1, 0.05]
    asked = smooth_image, start, kernels, roots, units, most, tolerance, hopeless
    found, expected = descent.descend(*asked), descend_twin(*asked)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12)
    assert found[1] == pytest.approx(expected[1], rel=1e-12)
    assert found[2] == expected[2]
    assert (found[2] == 1) == (hopeless < 1)
