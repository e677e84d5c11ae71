"""The compiled kernels and their descent, against the same formulas in plain NumPy."""

import numpy as np
import pytest

from tracking.loops import descent

RNG = np.random.default_rng(5)


def histogram_twin(image, state, half, centres, span, levels, stride):
    (half_width, half_height), (span_x, span_y) = half, span
    x, y, theta, log_scale = state
    scale, c, s = np.exp(log_scale), np.cos(theta), np.sin(theta)
    rows = np.arange(image.shape[0])
    columns = np.arange(image.shape[1])
    reach_x = scale * (abs(c) * half_width + abs(s) * half_height) + stride
    reach_y = scale * (abs(s) * half_width + abs(c) * half_height) + stride
    first_i, first_j = max(0, int(y - reach_y)), max(0, int(x - reach_x))
    # Those of the picture, wherever the target is.
    rows = rows[first_i // stride * stride :: stride]
    columns = columns[first_j // stride * stride :: stride]
    j, i = np.meshgrid(columns, rows)
    dx, dy = j + 0.5 - x, i + 0.5 - y
    rx, ry = (c * dx + s * dy) / scale, (-s * dx + c * dy) / scale
    cover_x = np.clip(scale * (half_width - abs(rx)) / stride + 0.5, 0, 1)
    cover_y = np.clip(scale * (half_height - abs(ry)) / stride + 0.5, 0, 1)
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
    sums, totals = descent.kernel_histograms(smooth_image, state, *SHAPE, stride)
    twin = histogram_twin(smooth_image, state, *SHAPE, stride)
    np.testing.assert_allclose(sums[:, :, 0], twin, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(totals[:, 0], twin.sum(axis=1), rtol=1e-12)


@pytest.fixture
def both(monkeypatch):
    """What the compiled loop gives, and what it gives as plain Python, which refuses an index
    beyond an array's end.
    """

    def histograms(*case):
        yield descent.kernel_histograms(*case)
        with monkeypatch.context() as plain:
            for name, loop in list(vars(descent).items()):
                if hasattr(loop, "py_func"):
                    plain.setattr(descent, name, loop.py_func)
            yield descent.kernel_histograms(*case)

    return histograms


def full(*channels):
    image = np.zeros((30, 40, 3), np.uint8)
    image[..., list(channels)] = 255
    return image


NOISE = np.random.default_rng(7)
IMAGES = {
    "black": full(), "white": full(0, 1, 2), "red": full(0), "green": full(1), "blue": full(2),
    "cyan": full(1, 2), "black or white": NOISE.choice([0, 255], (30, 40, 3)).astype(np.uint8),
    "centres of bins": (32 * NOISE.integers(0, 8, (30, 40, 3)) + 16).astype(np.uint8),
}  # fmt: skip
for each in IMAGES.values():
    each.setflags(write=False)
SMALL = ((4.0, 3.0), np.array([[-2.0, -1.0], [2.0, 1.0]]), (3.0, 2.5))


@pytest.mark.parametrize("levels", [2, 3, 8])
@pytest.mark.parametrize("name", IMAGES)
def test_saturated_colours_stay_in_their_bins(both, name, levels):
    state = np.array([20.2, 15.1, 0.4, 0.1])
    twin = histogram_twin(IMAGES[name], state, *SMALL, levels, 1)
    for sums, totals in both(IMAGES[name], state, *SMALL, levels, 1):
        np.testing.assert_allclose(sums[:, :, 0], twin, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(totals[:, 0], twin.sum(axis=1), rtol=1e-12)
        np.testing.assert_allclose(sums.sum(axis=1), totals, rtol=1e-9, atol=1e-9)


PLACES = {
    "left": (0.0, 15.0), "right": (40.0, 15.0), "top": (20.0, 0.0), "bottom": (20.0, 30.0),
    "corner": (40.0, 30.0), "just beyond": (40.5, 15.0), "left of it": (-9.0, 15.0),
    "right of it": (55.0, 15.0), "above it": (20.0, -9.0), "below it": (20.0, 40.0),
}  # fmt: skip


@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize("name", PLACES)
def test_a_target_at_the_edge_or_outside_is_read_as_far_as_it_is_seen(both, name, stride):
    image, seen = NOISE.integers(0, 256, (30, 40, 3)).astype(np.uint8), []
    for turn, size in ((0.0, 0.0), (0.8, 0.3), (np.pi / 2, -0.4)):
        state = np.array([*PLACES[name], turn, size])
        twin = histogram_twin(image, state, *SMALL, 4, stride)
        seen.append(twin.sum())
        for sums, totals in both(image, state, *SMALL, 4, stride):
            np.testing.assert_allclose(sums[:, :, 0], twin, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(totals[:, 0], twin.sum(axis=1), rtol=1e-12, atol=1e-12)
    assert any(seen) != name.endswith(" it")


def test_a_pixel_on_the_rim_of_the_template_counts_by_half_and_one_beyond_it_does_not():
    """Upright, unscaled: pixel centres lie 3.5, 4.0 and 4.5 px from the middle in turn."""
    image = np.zeros((9, 12, 3), np.uint8)
    for x, count in ((6.0, 8), (6.5, 7 + 2 * 0.5)):
        kernels = np.zeros((1, 2)), (1e9, 1e9), 2, 1
        _, totals = descent.kernel_histograms(image, np.array([x, 4.5, 0, 0]), (4.0, 0.5), *kernels)
        assert totals[0, 0] == pytest.approx(count)


@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize(("state", "step"), [(CASES[0][0], 1e-6), (CASES[1][0], 1e-6)])
def test_kernel_histogram_derivatives_agree_with_finite_differences(
    smooth_image, state, step, stride
):
    state = state + [0.123, 0.217, 0.05, 0.03]  # away from where a pixel's coverage has its kinks
    sums, totals = descent.kernel_histograms(smooth_image, state, *SHAPE, stride)
    for p in range(4):
        d = step * np.eye(4)[p]
        forward, f_total = descent.kernel_histograms(smooth_image, state + d, *SHAPE, stride)
        back, b_total = descent.kernel_histograms(smooth_image, state - d, *SHAPE, stride)
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


def test_normal_equations_of_empty_histograms_are_finite():
    root = np.full((2, 8), 0.3)
    nothing = np.zeros((2, 8, 5)), np.zeros((2, 5)), root, 1e-3
    cost, gradient, curvature = descent.ssd_normal_equations(*nothing)
    assert cost == pytest.approx(8 * (np.sqrt(1e-3) - 0.3) ** 2)
    assert [*gradient, *curvature.ravel()] == [0.0] * 20


def test_a_large_target_is_read_at_every_second_or_third_pixel(smooth_image):
    for pixels, stride in ((8 * 2000, 1), (1500, 1), (1499 / 4, 2), (1500 / 9, 3)):
        state = np.array([80.0, 60.0, 0.1, 0.0])
        kernels = (*SHAPE, pixels)
        assert descent.stride_for(state, kernels) == stride
        found = descent.histograms(smooth_image, state, kernels, stride)
        expected = descent.kernel_histograms(smooth_image, state, *SHAPE, stride)
        np.testing.assert_array_equal(found[0], expected[0])


def test_a_damped_step_agrees_with_numpy():
    rows = RNG.normal(0, 1, (12, 4))
    H, g = rows.T @ rows, RNG.normal(0, 1, 4)
    units = np.array([1.0, 1.0, 0.05, 0.05])
    scaled = H * np.outer(units, units)
    scaled[np.diag_indices(4)] += 0.3 * np.trace(scaled) / 4
    expected = -units * np.linalg.solve(scaled, units * g)
    np.testing.assert_allclose(descent.damped_step(g, H, 0.3, units), expected, rtol=1e-12)


def test_equations_whose_rows_change_places_are_solved():
    for n in (1, 2, 5):
        A, b = RNG.normal(0, 1, (n, n)), RNG.normal(0, 1, n)
        A[0, 0] = 1e-9
        expected = np.linalg.solve(A, b)
        np.testing.assert_allclose(descent.solved(A.copy(), b.copy()), expected, rtol=1e-9)


def descend_twin(image, x, kernels, roots, units, most, tolerance, hopeless):
    stride = descent.stride_for(x, kernels)
    cost, g, H = descent.linearise(image, x, kernels, roots, stride)
    damping, evaluations = descent.FIRST_DAMPING, 1
    while cost <= hopeless and evaluations < most and damping < descent.MOST_DAMPING:
        step = descent.damped_step(g, H, damping, units)
        if np.abs(step / units).max() < tolerance:
            return x + step, cost, evaluations
        there = descent.linearise(image, x + step, kernels, roots, stride)
        evaluations += 1
        if there[0] < cost:
            x, damping, (cost, g, H) = x + step, damping * descent.LESS, there
        else:
            damping *= descent.MORE
    return x, cost, evaluations


def test_a_descent_ends_before_the_scale_leaves_its_limits(smooth_image, monkeypatch):
    units, start = np.array([1.0, 1.0, 0.05, 0.05]), np.array([63.0, 43.0, 0.3, 0.05])
    kernels, roots = (*SHAPE, 2000), np.full((3, 512), 0.05)
    _, *slope = descent.linearise(smooth_image, start, kernels, roots, 1)
    there = abs(start + descent.damped_step(*slope, descent.FIRST_DAMPING, units))[3]
    for limit, ends in ((there, False), (np.nextafter(there, 0), True)):
        monkeypatch.setattr(descent, "LARGEST_LOG", limit)
        asked = smooth_image, start, kernels, roots, units, 2, 0.0, 9.0
        x, _, evaluations = descent.descend.py_func(*asked)
        assert (evaluations == 1) is ends
        assert not ends or x.tolist() == start.tolist()


@pytest.mark.parametrize(
    ("most", "tolerance", "hopeless"),
    [(8, 0.2, 2.0), (30, 0.0, 2.0), (3, 0.0, 2.0), (8, 0.2, 1e-3)],
    ids=["until the step is short", "until no step is better", "cut off", "hopeless"],
)
def test_a_descent_agrees_with_python(smooth_image, most, tolerance, hopeless):
    *parts, levels = SHAPE
    true, units = np.array([60.0, 45.0, 0.2, 0.0]), np.array([1.0, 1.0, 0.05, 0.05])
    kernels = (*parts, levels, 2000)
    sums, totals = descent.histograms(smooth_image, true, kernels, 1)
    roots = np.sqrt(sums[:, :, 0] / totals[:, :1] + descent.FLOOR)
    start = true + [3.0, -2.0, 0.1, 0.05]
    asked = smooth_image, start, kernels, roots, units, most, tolerance, hopeless
    found, expected = descent.descend(*asked), descend_twin(*asked)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-12)
    assert found[1] == pytest.approx(expected[1], rel=1e-12)
    assert found[2] == expected[2]
    assert (found[2] == 1) == (hopeless < 1)
