"""The compiled loops of views give what NumPy gives."""

import numpy as np

from tracking.loops import view_correlation as loops

RNG = np.random.default_rng(0)


def view_twin(image, state, points):
    """The colours at points in the picture, less their mean; zero off it; of length 1."""
    x, y, theta, log_scale = state
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    u, v = np.floor(np.exp(log_scale) * points @ turn.T + (x, y)).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < image.shape[1]) & (v < image.shape[0])
    found = np.zeros((len(points), 3))
    found[inside] = image[v[inside], u[inside]]
    found[inside] -= found[inside].mean(axis=0)
    return found.ravel() / np.linalg.norm(found)


def test_views_agree_with_numpy():
    image = RNG.integers(0, 256, (40, 50, 3), dtype=np.uint8)
    states = np.column_stack(
        [RNG.uniform(0, 50, 9), RNG.uniform(0, 40, 9), RNG.normal(size=(9, 2))]
    )
    points = RNG.uniform(-9, 9, (30, 2))
    stored = np.stack([view_twin(image, s, points) for s in states[:2]])
    twins = np.stack([view_twin(image, s, points) for s in states])
    np.testing.assert_allclose(loops.view(image, states[3], points), twins[3], atol=1e-12)
    found = loops.correlations(image, states, points, stored)
    np.testing.assert_allclose(found, (twins @ stored.T).max(axis=1), rtol=0, atol=1e-12)
    nothing = loops.view(np.full_like(image, 7), states[0], points)
    assert not nothing.any()
