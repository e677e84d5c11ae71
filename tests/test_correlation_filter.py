"""The compiled loops of the correlation filter give what NumPy gives, and the filter finds what it
has learned.
"""

import numpy as np
import pytest

from tracking.appearance.correlation_filter import CorrelationFilter
from tracking.loops import correlation_filter as loops
from tracking.types import Region

RNG = np.random.default_rng(0)
GREY = RNG.uniform(0, 255, (40, 50)).astype(np.float32)
POINTS = RNG.uniform(-9, 9, (30, 2))
STATES = np.column_stack(
    [RNG.uniform(-5, 55, 9), RNG.uniform(-5, 45, 9), RNG.normal(size=9), RNG.normal(0, 0.3, 9)]
)


def interpolated(values, u, v):
    """Values between the places of an array, by bilinear interpolation."""
    j, i = np.floor(u).astype(int), np.floor(v).astype(int)
    a, b = u - j, v - i
    upper = (1 - a) * values[i, j] + a * values[i, j + 1]
    lower = (1 - a) * values[i + 1, j] + a * values[i + 1, j + 1]
    return (1 - b) * upper + b * lower


def patch_twin(grey, state, points):
    """Grey levels at template points; beyond the border the last pixels go on."""
    x, y, theta, log_scale = state
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    u, v = (np.exp(log_scale) * points @ turn.T + (x - 0.5, y - 0.5)).T
    height, width = grey.shape
    return interpolated(grey.astype(float), u.clip(0, width - 1.001), v.clip(0, height - 1.001))


def gradients_twin(levels):
    """Histograms of gradients by orientation, normalised by the mean energy of 3 x 3 cells."""
    padded = np.pad(levels, 1, mode="edge")
    x = padded[1:-1, 2:] - padded[1:-1, :-2]
    y = padded[2:, 1:-1] - padded[:-2, 1:-1]
    at = np.mod(np.arctan2(y, x) / np.pi, 1.0) * loops.ORIENTATIONS
    low = np.floor(at).astype(int) % loops.ORIENTATIONS
    share = at - np.floor(at)
    found = np.zeros((loops.ORIENTATIONS, *levels.shape))
    i, j = np.indices(levels.shape)
    found[low, i, j] += (1 - share) * np.hypot(x, y)
    found[(low + 1) % loops.ORIENTATIONS, i, j] += share * np.hypot(x, y)
    rows, columns = levels.shape[0] // 2, levels.shape[1] // 2
    found = found.reshape(-1, rows, 2, columns, 2).sum(axis=(2, 4))
    energy = np.pad((found**2).sum(axis=0), 1, constant_values=np.nan)
    around = [energy[a : a + rows, b : b + columns] for a in range(3) for b in range(3)]
    return np.minimum(found / np.sqrt(4 * np.nanmean(around, axis=0) + 1), loops.LARGEST)


def test_patches_and_correlations_agree_with_numpy():
    twins = np.stack([patch_twin(GREY, state, POINTS) for state in STATES])
    found = np.stack([loops.patch(GREY, state, POINTS) for state in STATES])
    np.testing.assert_allclose(found, twins, rtol=0, atol=1e-3)
    unit = twins - twins.mean(axis=1, keepdims=True)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    alike = loops.correlations(GREY, STATES, POINTS, unit[:2])
    np.testing.assert_allclose(alike, unit @ unit[:2].T, rtol=0, atol=1e-5)
    plain = loops.correlations(np.full_like(GREY, 7), STATES, POINTS, unit[:2])
    assert not plain.any()


def test_gradients_agree_with_numpy():
    levels = RNG.uniform(0, 255, (16, 20))
    np.testing.assert_allclose(loops.gradients(levels), gradients_twin(levels), atol=1e-5)


def test_places_in_an_answer_agree_with_numpy():
    answer = RNG.normal(size=(12, 14))
    centre = np.array([20.0, 15.0, 0.4, 0.2])
    size = 1.7 * np.exp(0.2)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    u, v = ((STATES[:, :2] - centre[:2]) @ turn / size).T + [[7], [6]]
    inside = (u >= 0) & (v >= 0) & (u < 13) & (v < 11)
    wanted = np.full(len(STATES), -0.05)
    wanted[inside] = interpolated(answer, u[inside], v[inside])
    assert 0 < inside.sum() < len(STATES)
    found = loops.looked_up(answer, STATES, centre, 1.7, -0.05)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


@pytest.mark.parametrize("shift", [(0, 0), (5, -3), (-4, 6)])
def test_the_filter_answers_where_the_target_has_moved(smooth_image, shift):
    region = Region(32.0, 24.0)
    filter_ = CorrelationFilter(region)
    grey = smooth_image.mean(axis=2).astype(np.float32)
    middle = np.array([60.0, 50.0, 0.0, 0.0])
    filter_.learn(loops.patch(grey, middle, filter_.points))
    filter_.read(loops.patch(grey, middle - [*shift, 0, 0], filter_.points))
    # The window is cut off by its taper, so that the peak lies a part of a cell nearer.
    assert np.abs(filter_.peak - shift).max() <= filter_.step
    assert 0.3 < filter_.answer.max() < 1.0
