"""Each compiled loop against the same formula in plain NumPy."""

import numpy as np
import pytest

from tracking.hot import annealing, colour, newton, sampled
from tracking.hot import kernels as hot

RNG = np.random.default_rng(5)


def coefficient_twin(window, states, points, parts, weights, root_q):
    labels, left, top = window
    out = np.zeros((len(states), len(root_q)))
    for n, (x, y, theta, log_scale) in enumerate(states):
        c, s = np.exp(log_scale) * np.cos(theta), np.exp(log_scale) * np.sin(theta)
        u = x - left + c * points[:, 0] - s * points[:, 1]
        v = y - top + s * points[:, 0] + c * points[:, 1]
        inside = (u >= 0) & (v >= 0) & (u < labels.shape[1]) & (v < labels.shape[0])
        for k in range(len(root_q)):
            of_part = inside & (parts == k)
            seen = labels[v[of_part].astype(int), u[of_part].astype(int)]
            histogram = np.bincount(
                seen[seen >= 0], weights[of_part][seen >= 0], minlength=root_q.shape[1]
            )
            out[n, k] = np.sum(root_q[k] * np.sqrt(histogram))
    return out


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


def sampled_case():
    labels = RNG.integers(-1, 16, (40, 50)).astype(np.int16)
    states = np.column_stack(
        [
            RNG.uniform(0, 70, 20),
            RNG.uniform(0, 60, 20),
            RNG.uniform(-4, 4, 20),
            RNG.normal(0, 0.3, 20),
        ]
    )
    points, parts = RNG.uniform(-12, 12, (90, 2)), RNG.integers(0, 3, 90)
    return (
        (labels, 7, 5),
        states,
        points,
        parts,
        RNG.random(90),
        np.sqrt(RNG.dirichlet(np.ones(16), 3)),
    )


def test_coefficients_agree_with_numpy():
    case = sampled_case()
    np.testing.assert_allclose(
        sampled.coefficients(*case), coefficient_twin(*case), rtol=0, atol=1e-13
    )


def test_squared_distances_agree_with_numpy():
    rho = RNG.uniform(0.8, 1.1, (20, 9))
    expected = np.maximum(1 - rho.mean(axis=1), 0)
    assert 0 < (expected == 0).sum() < 20
    np.testing.assert_allclose(sampled.squared_distances(rho), expected, atol=1e-14)


def test_histograms_agree_with_numpy():
    window, states, points, parts, weights, root = sampled_case()
    found = sampled.histograms(window, states[0], points, parts, weights, *root.shape)
    labels, left, top = window
    x, y, theta, log_scale = states[0]
    c, s = np.exp(log_scale) * np.cos(theta), np.exp(log_scale) * np.sin(theta)
    u = x - left + c * points[:, 0] - s * points[:, 1]
    v = y - top + s * points[:, 0] + c * points[:, 1]
    twin = np.zeros(root.shape)
    for p in np.flatnonzero((u >= 0) & (v >= 0) & (u < labels.shape[1]) & (v < labels.shape[0])):
        label = labels[int(v[p]), int(u[p])]
        if label >= 0:
            twin[parts[p], label] += weights[p]
    np.testing.assert_allclose(found, twin, rtol=0, atol=1e-13)
    assert twin.sum() > 1.0


def test_the_exponent_agrees_with_numpy():
    w, target = -RNG.gamma(2.0, 3.0, 50), 20.0
    low, high = 0.0, 100.0
    for _ in range(30):
        middle = (low + high) / 2
        weights = np.exp(middle * (w - w.max()))
        weights /= weights.sum()
        low, high = (middle, high) if 1 / np.sum(weights**2) > target else (low, middle)
    assert annealing.exponent(w, target, 100.0, 30) == pytest.approx(low, rel=1e-9)


def test_mean_shift_reports_the_coefficients_of_where_it_ends():
    window, states, points, _, weights, root = sampled_case()
    ends, rho, _ = sampled.mean_shift(window, states, points, weights, root[:1], 15, 0.1)
    parts = np.zeros(len(points), np.int64)
    again = coefficient_twin(window, ends, points, parts, weights, root[:1])[:, 0]
    before = coefficient_twin(window, states, points, parts, weights, root[:1])[:, 0]
    np.testing.assert_allclose(rho, again, atol=1e-12)
    assert np.all(rho >= before - 1e-12)


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
    cost, gradient, curvature = newton.ssd_normal_equations(sums, totals, root, floor)
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
    np.testing.assert_allclose(newton.damped_step(g, H, 0.3, units), expected, rtol=1e-12)


def descend_twin(image, x, kernels, roots, units, most, tolerance, hopeless):
    cost, g, H = newton.linearise(image, x, kernels, roots)
    damping, evaluations = newton.FIRST_DAMPING, 1
    while cost <= hopeless and evaluations < most and damping < newton.MOST_DAMPING:
        step = newton.damped_step(g, H, damping, units)
        if np.abs(step / units).max() < tolerance:
            return x + step, cost, evaluations
        there = newton.linearise(image, x + step, kernels, roots)
        evaluations += 1
        if there[0] < cost:
            x, damping, (cost, g, H) = x + step, damping * newton.LESS, there
        else:
            damping *= newton.MORE
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
    sums, totals = newton.histograms(smooth_image, true, kernels)
    roots = np.sqrt(sums[:, :, 0] / totals[:, :1] + newton.FLOOR)
    start = true + [3.0, -2.0, 0.1, 0.05]
    asked = smooth_image, start, kernels, roots, units, most, tolerance, hopeless
    found, expected = newton.descend(*asked), descend_twin(*asked)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12)
    assert found[1] == pytest.approx(expected[1], rel=1e-12)
    assert found[2] == expected[2]
    assert (found[2] == 1) == (hopeless < 1)


@pytest.mark.parametrize("bits", [1, 3, 5])
def test_colour_labels_agree_with_numpy(bits):
    image = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    red, green, blue = np.moveaxis(image[3:17, 4:29].astype(int) >> (8 - bits), -1, 0)
    expected = (red << 2 * bits) | (green << bits) | blue
    np.testing.assert_array_equal(colour.labels(image, 4, 3, 29, 17, bits), expected)
    assert colour.labels(image, 9, 9, 9, 5, bits).shape == (0, 0)


def test_evened_colours_agree_and_hardly_depend_on_the_light():
    image = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    whole = image.max(axis=2, keepdims=True).astype(int) + 8
    np.testing.assert_array_equal(colour.evened(image, 8), 255 * image.astype(int) // whole)
    bright = np.array([[[200, 120, 40]]], np.uint8)
    dim = (bright * 0.7).astype(np.uint8)
    change = colour.evened(dim, 8).astype(int) - colour.evened(bright, 8)
    assert np.abs(change).max() <= 5  # of 60 without
