"""Each compiled loop against the same formula in plain NumPy."""

import numpy as np
import pytest

from tracking.hot import colour_labels, exponents, point_histograms

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
        point_histograms.coefficients(*case), coefficient_twin(*case), rtol=0, atol=1e-13
    )


def test_squared_distances_agree_with_numpy():
    rho = RNG.uniform(0.8, 1.1, (20, 9))
    expected = np.maximum(1 - rho.mean(axis=1), 0)
    assert 0 < (expected == 0).sum() < 20
    np.testing.assert_allclose(point_histograms.squared_distances(rho), expected, atol=1e-14)


def test_histograms_agree_with_numpy():
    window, states, points, parts, weights, root = sampled_case()
    found = point_histograms.histograms(window, states[0], points, parts, weights, *root.shape)
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
    assert exponents.exponent(w, target, 100.0, 30) == pytest.approx(low, rel=1e-9)


def test_mean_shift_reports_the_coefficients_of_where_it_ends():
    window, states, points, _, weights, root = sampled_case()
    ends, rho, _ = point_histograms.mean_shift(window, states, points, weights, root[:1], 15, 0.1)
    parts = np.zeros(len(points), np.int64)
    again = coefficient_twin(window, ends, points, parts, weights, root[:1])[:, 0]
    before = coefficient_twin(window, states, points, parts, weights, root[:1])[:, 0]
    np.testing.assert_allclose(rho, again, atol=1e-12)
    assert np.all(rho >= before - 1e-12)


@pytest.mark.parametrize("bits", [1, 3, 5])
def test_colour_labels_agree_with_numpy(bits):
    image = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    red, green, blue = np.moveaxis(image[3:17, 4:29].astype(int) >> (8 - bits), -1, 0)
    expected = (red << 2 * bits) | (green << bits) | blue
    np.testing.assert_array_equal(colour_labels.labels(image, 4, 3, 29, 17, bits), expected)
    assert colour_labels.labels(image, 9, 9, 9, 5, bits).shape == (0, 0)


def test_evened_colours_agree_and_hardly_depend_on_the_light():
    image = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    whole = image.max(axis=2, keepdims=True).astype(int) + 8
    np.testing.assert_array_equal(colour_labels.evened(image, 8), 255 * image.astype(int) // whole)
    bright = np.array([[[200, 120, 40]]], np.uint8)
    dim = (bright * 0.7).astype(np.uint8)
    change = colour_labels.evened(dim, 8).astype(int) - colour_labels.evened(bright, 8)
    assert np.abs(change).max() <= 5  # of 60 without
