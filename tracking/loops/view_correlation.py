"""Compiled loops: correlation of a picture at a state of the target with stored views, which are
pictures of a few points of the target.
"""

import numpy as np

from sim.compiled import compiled
from sim.types import Array, Image

LEAST = 1e-6
"""Least sum of squares of a view with contrast; a view with less correlates with nothing."""


@compiled()
def view(image: Image, state: Array, points: Array) -> Array:
    """Return the colours (3 P,) at the template points of a target in a state: each channel less
    its mean, and all divided by their norm; zeros if there is no contrast.

    Points off the image count as the mean colour.

    Args:
        image: RGB (H, W, 3).
        state: x, y [px], theta [rad], ln scale (4,).
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
    """
    height, width = image.shape[:2]
    found = np.zeros((len(points), 3))
    inside = np.zeros(len(points))
    scale = np.exp(state[3])
    c = scale * np.cos(state[2])
    s = scale * np.sin(state[2])
    for p in range(len(points)):
        u = state[0] + c * points[p, 0] - s * points[p, 1]
        v = state[1] + s * points[p, 0] + c * points[p, 1]
        if 0.0 <= u < width and 0.0 <= v < height:
            inside[p] = 1.0
            for k in range(3):
                found[p, k] = image[np.uint32(v), np.uint32(u), k]
    # Points off the image get 0, which is the mean after it is subtracted: they do not correlate.
    count = max(np.sum(inside), 1.0)
    squares = 0.0
    for k in range(3):
        mean = np.sum(found[:, k]) / count
        for p in range(len(points)):
            found[p, k] = inside[p] * (found[p, k] - mean)
            squares += found[p, k] * found[p, k]
    if squares < LEAST:
        return np.zeros(3 * len(points))
    return found.ravel() / np.sqrt(squares)


@compiled()
def correlations(image: Image, states: Array, points: Array, stored: Array) -> Array:
    """Return for each of N states the largest correlation (N,), -1..1, of the picture there with
    the stored views of the target; 0 where the picture has no contrast.

    Args:
        image: RGB (H, W, 3).
        states: x, y [px], theta [rad], ln scale (N, 4).
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
        stored: Views (M, 3 P), each as the function `view` returns it.
    """
    found = np.full(len(states), -1.0)
    for n in range(len(states)):
        seen = view(image, states[n], points)
        for m in range(len(stored)):
            product = 0.0  # views have mean 0 and length 1, so their product is the correlation
            for i in range(len(seen)):
                product += seen[i] * stored[m, i]
            found[n] = max(found[n], product)
    return found
