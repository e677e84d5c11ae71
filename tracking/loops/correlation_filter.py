"""Compiled loops: grey levels at the points of a target's template, histograms of gradients, and
interpolation in a map of filter outputs.
"""

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array

Levels = NDArray[np.float32]
"""Grey levels of a picture, 0 to 255, or histograms of their gradients."""

LEAST = 1e-6
"""Least sum of squares of a patch with contrast; a patch with less correlates with nothing."""
ORIENTATIONS = 9
"""Orientations of gradients, between 0 and 180 deg."""
LARGEST = 0.4
"""Largest value of a normalised histogram: one strong edge does not outweigh the others."""


@compiled(error_model="numpy", fastmath=("contract",))
def _between(values: Levels | Array, u: float, v: float) -> float:
    """Return the bilinearly interpolated value of an array (H, W) in column u and row v, which are
    at least 0 and below W - 1 and H - 1.
    """
    j = np.uint32(u)
    i = np.uint32(v)
    a = u - j
    b = v - i
    upper = (1 - a) * values[i, j] + a * values[i, j + 1]
    lower = (1 - a) * values[i + 1, j] + a * values[i + 1, j + 1]
    return (1 - b) * upper + b * lower


@compiled(error_model="numpy", fastmath=("contract",))
def patch(grey: Levels, state: Array, points: Array) -> Array:
    """Return the grey levels (P,) at the template points of a target in a state, by bilinear
    interpolation; beyond the picture's border those of the nearest pixels.

    Args:
        grey: Picture (H, W), at least 2 x 2 pixels.
        state: x, y [px], theta [rad], ln scale (4,).
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
    """
    height, width = grey.shape
    found = np.empty(len(points))
    scale = np.exp(state[3])
    c = scale * np.cos(state[2])
    s = scale * np.sin(state[2])
    for p in range(len(points)):
        u = min(max(state[0] + c * points[p, 0] - s * points[p, 1] - 0.5, 0.0), width - 1.001)
        v = min(max(state[1] + s * points[p, 0] + c * points[p, 1] - 0.5, 0.0), height - 1.001)
        found[p] = _between(grey, u, v)
    return found


@compiled(error_model="numpy", fastmath=("contract",))
def correlations(grey: Levels, states: Array, points: Array, templates: Array) -> Array:
    """Return the correlations (N, M), -1..1, of a picture at N states with M templates; 0 where the
    picture has no contrast.

    Args:
        grey: Picture (H, W), at least 2 x 2 pixels.
        states: x, y [px], theta [rad], ln scale (N, 4).
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
        templates: Grey levels (M, P) of mean 0 and length 1.
    """
    found = np.zeros((len(states), len(templates)))
    for n in range(len(states)):
        seen = patch(grey, states[n], points)
        mean = 0.0
        squares = 0.0
        for p in range(len(seen)):
            mean += seen[p]
            squares += seen[p] * seen[p]
        mean /= len(seen)
        squares -= len(seen) * mean * mean
        if squares < LEAST:
            continue
        for m in range(len(templates)):
            product = 0.0
            for p in range(len(seen)):
                product += seen[p] * templates[m, p]
            found[n, m] = product / np.sqrt(squares)
    return found


@compiled(error_model="numpy", fastmath=("contract",))
def _normalise(found: Levels) -> None:
    """Divide the histograms (9, R, C), in place, by sqrt(1 + 4 m), where m is the mean sum of
    squares of the histograms in the 3 x 3 cells around each, and clip them to at most `LARGEST`.
    """
    count, rows, columns = found.shape
    energy = np.zeros((rows, columns))
    for k in range(count):
        for i in range(rows):
            for j in range(columns):
                energy[i, j] += found[k, i, j] * found[k, i, j]
    for i in range(rows):
        for j in range(columns):
            total = 0.0
            cells = 0
            for y in range(max(i - 1, 0), min(i + 2, rows)):
                for x in range(max(j - 1, 0), min(j + 2, columns)):
                    total += energy[y, x]
                    cells += 1
            norm = np.sqrt(4.0 * total / cells + 1.0)
            for k in range(count):
                found[k, i, j] = min(found[k, i, j] / norm, LARGEST)


@compiled(error_model="numpy", fastmath=("contract",))
def gradients(levels: Array) -> Levels:
    """Return histograms (9, R, C) of the gradients in cells of 2 x 2 pixels by their orientation,
    which has nine bins from 0 to 180 deg: each gradient counts by its strength, shared between the
    two nearest bins.

    Each histogram is divided by sqrt(1 + 4 m), where m is the mean sum of squares of the histograms
    in the 3 x 3 cells around it, and clipped to at most 0.4.

    Args:
        levels: Grey levels (2 R, 2 C), 0..255.
    """
    height, width = levels.shape
    rows = height // 2
    columns = width // 2
    found = np.zeros((ORIENTATIONS, rows, columns), np.float32)
    for i in range(height):
        above = max(i - 1, 0)
        below = min(i + 1, height - 1)
        for j in range(width):
            x = levels[i, min(j + 1, width - 1)] - levels[i, max(j - 1, 0)]
            y = levels[below, j] - levels[above, j]
            strength = np.sqrt(x * x + y * y)
            angle = np.arctan2(y, x) / np.pi
            if angle < 0:
                angle += 1.0
            at = angle * ORIENTATIONS
            low = int(at)
            share = at - low
            low = low % ORIENTATIONS
            high = (low + 1) % ORIENTATIONS
            found[low, i // 2, j // 2] += (1 - share) * strength
            found[high, i // 2, j // 2] += share * strength
    _normalise(found)
    return found


@compiled(error_model="numpy", fastmath=("contract",))
def looked_up(response: Array, states: Array, centre: Array, step: float, outside: float) -> Array:
    """Return the values (N,) of a map of filter outputs at the positions x, y of N states, by
    bilinear interpolation.

    Args:
        response: Map (R, C), whose element in row R // 2 and column C // 2 is at `centre`.
        states: x, y [px], theta [rad], ln scale (N, 4); angle and scale are not used.
        centre: State (4,) at which the map was computed, whose angle and scale the map has.
        step: Distance of two neighbouring values of the map at scale 1 [px].
        outside: Value beyond the map's border.
    """
    rows, columns = response.shape
    found = np.full(len(states), outside)
    size = step * np.exp(centre[3])
    c = np.cos(centre[2]) / size
    s = np.sin(centre[2]) / size
    for n in range(len(states)):
        x = states[n, 0] - centre[0]
        y = states[n, 1] - centre[1]
        u = columns // 2 + c * x + s * y
        v = rows // 2 - s * x + c * y
        if 0.0 <= u < columns - 1 and 0.0 <= v < rows - 1:
            found[n] = _between(response, u, v)
    return found
