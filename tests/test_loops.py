"""Each compiled loop against the same formula in plain NumPy."""

import numpy as np
import pytest

from sim.types import Frame
from tracking.loops import colour_labels, particle_loops, point_histograms

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
            kept = 1 - weights[of_part][seen < 0].sum()
            out[n, k] = np.sum(root_q[k] * np.sqrt(histogram / kept))
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
    points, parts, kernel = RNG.uniform(-12, 12, (90, 2)), RNG.integers(0, 3, 90), RNG.random(90)
    return (
        (labels, 7, 5),
        states,
        points,
        parts,
        kernel / np.bincount(parts, kernel)[parts],
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
    assert twin.sum() > 0.1


def test_the_exponent_agrees_with_numpy():
    w, target = -RNG.gamma(2.0, 3.0, 50), 20.0
    low, high = 0.0, particle_loops.LARGEST_BETA
    for _ in range(particle_loops.BISECTIONS):
        middle = (low + high) / 2
        weights = np.exp(middle * (w - w.max()))
        weights /= weights.sum()
        low, high = (middle, high) if 1 / np.sum(weights**2) > target else (low, middle)
    assert particle_loops.exponent(w, target) == pytest.approx(low, rel=1e-9)


def test_mean_shift_reports_the_coefficients_of_where_it_ends():
    window, states, points, _, weights, root = sampled_case()
    parts, weights = np.zeros(len(points), np.int64), weights / weights.sum()
    case = (window, states, points, weights, np.ones(len(points)), root[:1])
    ends, rho, _ = point_histograms.mean_shift(*case, 15, 0.1)
    again = coefficient_twin(window, ends, points, parts, weights, root[:1])[:, 0]
    before = coefficient_twin(window, states, points, parts, weights, root[:1])[:, 0]
    np.testing.assert_allclose(rho, again, atol=1e-12)
    assert np.all(rho >= before - 1e-12)


@pytest.mark.parametrize("levels", [1, 2, 8, 10, 32])
def test_colour_labels_agree_with_numpy(levels):
    image = Frame(RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8), 0.0, 0).image
    red, green, blue = np.moveaxis(image[3:17, 4:29].astype(int) * levels // 256, -1, 0)
    expected = red * levels**2 + green * levels + blue
    np.testing.assert_array_equal(colour_labels.labels(image, 4, 3, 29, 17, levels), expected)
    assert colour_labels.labels(image, 9, 9, 9, 5, levels).shape == (0, 0)


def test_evened_colours_agree_and_hardly_depend_on_the_light():
    image = Frame(RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8), 0.0, 0).image
    whole = image.max(axis=2, keepdims=True).astype(int) + 8
    np.testing.assert_array_equal(colour_labels.evened(image, 8), 255 * image.astype(int) // whole)
    bright = Frame(np.array([[[200, 120, 40]]], np.uint8), 0.0, 0).image
    dim = Frame((bright * 0.7).astype(np.uint8), 0.0, 0).image
    change = colour_labels.evened(dim, 8).astype(int) - colour_labels.evened(bright, 8)
    assert np.abs(change).max() <= 5  # of 60 without


@pytest.fixture(params=["compiled", "interpreted"])
def loops(request, monkeypatch):
    """The loops of two modules, compiled and as plain Python, which refuses an index beyond an
    array's end.
    """
    for module in (point_histograms, particle_loops):
        for name, loop in list(vars(module).items()):
            if request.param == "interpreted" and hasattr(loop, "py_func"):
                monkeypatch.setattr(module, name, loop.py_func)


GRID = np.array([(u, v) for u in range(-3, 4) for v in range(-3, 4)], float)
BORDERS = [
    (x, y, turn, 0.0)
    for x in (4.0, 7.0, 57.0, 60.0)
    for y in (2.0, 5.0, 45.0, 48.0)
    for turn in (0.0, 0.3)
] + [(-50.0, 20.0, 0.0, 0.0), (20.0, 500.0, 0.0, 0.0)]
"""Around and on the edges of a window of 50 x 40 px at (7, 5), and far outside."""


@pytest.mark.usefixtures("loops")
def test_points_on_the_edges_of_a_window_are_read_and_those_beyond_are_not():
    labels = np.random.default_rng(3).integers(0, 16, (40, 50)).astype(np.int16)
    weights, parts = np.full(len(GRID), 1 / len(GRID)), np.arange(len(GRID)) % 2
    root = np.sqrt(np.random.default_rng(4).dirichlet(np.ones(16), 2))
    case = (labels, 7, 5), np.array(BORDERS), GRID, parts, weights, root
    found = point_histograms.coefficients(*case)
    np.testing.assert_allclose(found, coefficient_twin(*case), rtol=0, atol=1e-13)
    assert found[-2:].tolist() == [[0.0, 0.0], [0.0, 0.0]]


def shift_twin(window, state, points, weights, pulls, root):
    """Coefficient and mean-shift vector in the image (Comaniciu, Ramesh, Meer 2003)."""
    labels, left, top = window
    c, s = np.exp(state[3]) * np.array([np.cos(state[2]), np.sin(state[2])])
    turned = points @ np.array([[c, s], [-s, c]])
    u, v = (turned + state[:2] - (left, top)).T
    inside = (u >= 0) & (v >= 0) & (u < labels.shape[1]) & (v < labels.shape[0])
    seen = np.full(len(points), -1)
    seen[inside] = labels[v[inside].astype(int), u[inside].astype(int)]
    known = seen >= 0
    histogram = np.bincount(seen[known], weights[known], minlength=len(root))
    pull = (root / np.sqrt(np.maximum(histogram, 1e-300)))[seen] * known * pulls
    kept = 1 - weights[inside & ~known].sum()
    rho = np.sum(root * np.sqrt(histogram / max(kept, 1e-9)))
    mass = pull.sum()
    return (rho, pull @ turned / mass) if mass > 0 else (0.0, np.zeros(2))


def mean_shift_twin(window, state, points, weights, pulls, root, most, tolerance):
    rho, step = shift_twin(window, state, points, weights, pulls, root)
    count = 1
    while count < most and step @ step > tolerance**2:
        there = state + [*step, 0, 0]
        better, following = shift_twin(window, there, points, weights, pulls, root)
        count += 1
        if better < rho:
            step = step / 2
        else:
            state, rho, step = there, better, following
    return state, rho, count


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize(("most", "tolerance"), [(15, 0.1), (1, 0.1), (2, 0.0), (40, 0.0)])
def test_mean_shift_agrees_with_python(most, tolerance):
    labels = np.random.default_rng(5).integers(-1, 16, (40, 50)).astype(np.int16)
    labels[10:25, 15:35] //= 4
    weights = np.random.default_rng(6).dirichlet(np.ones(len(GRID)))
    pulls = np.where(GRID[:, 0] > 0, 2.0, 1.0)  # else a step may end on a pixel's very edge
    root = np.sqrt(np.random.default_rng(7).dirichlet(np.full(16, 0.4)))
    states = np.array([*BORDERS, (25.3, 20.2, 0.4, 0.5), (40.0, 30.0, -1.0, 0.2)])
    found = point_histograms.mean_shift(
        (labels, 7, 5), states, GRID, weights, pulls, root[None], most, tolerance
    )
    twins = [
        mean_shift_twin((labels, 7, 5), state, GRID, weights, pulls, root, most, tolerance)
        for state in states
    ]
    np.testing.assert_allclose(found[0], [twin[0] for twin in twins], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[1], [twin[1] for twin in twins], rtol=0, atol=1e-12)
    assert found[2] == sum(twin[2] for twin in twins)


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize(
    ("weights", "first", "drawn"),
    [
        ([0.25] * 4, 0.0, [0, 1, 2, 3]),
        ([0.5, 0.5], 1.0, [1, 1]),
        ([0.0, 0.0, 1.0], 0.0, [2, 2, 2]),
        ([1.0, 0.0, 0.0], 0.5, [0, 0, 0]),
    ],
)
def test_positions_at_the_end_of_a_sample_belong_to_the_next_one(weights, first, drawn):
    assert particle_loops.systematic(np.array(weights), first).tolist() == drawn


@pytest.mark.parametrize(("target", "expected"), [(7.9, None), (8.0, 0.0), (9.0, 0.0)])
def test_equal_likelihoods_have_the_highest_exponent_up_to_their_number(target, expected):
    found = particle_loops.exponent(np.full(8, -3.0), target)
    last = 1 - 2.0**-particle_loops.BISECTIONS
    assert found == (particle_loops.LARGEST_BETA * last if expected is None else expected)


@pytest.mark.parametrize("levels", [2, 8, 10, 32])
def test_labels_of_saturated_colours_are_the_first_and_last_bins(levels):
    for red, green, blue in np.ndindex(2, 2, 2):
        colour = 255 * np.array([red, green, blue])
        image = Frame(np.full((2, 3, 3), colour, np.uint8), 0.0, 0).image
        label = (levels - 1) * (red * levels**2 + green * levels + blue)
        assert (colour_labels.labels(image, 0, 0, 3, 2, levels) == label).all()
        whole = 255 * max(red, green, blue) + 8
        evened = 255 * 255 // whole * np.array([red, green, blue])
        assert (colour_labels.evened(image, 8) == evened).all()
