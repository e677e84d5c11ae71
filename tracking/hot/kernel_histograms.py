"""Compiled loops for histograms of pixels under Epanechnikov kernels, and their derivatives.

A state is (x, y, theta, ln scale); f_x maps an image point l into the template,
r = R(-theta) (l - (x, y)) / scale. Pixel (i, j) has its centre at (j + 0.5, i + 0.5).
"""

from typing import Any

import numpy as np

from sim.types import Array, Image
from tracking.hot.compiled import compiled

Weight = tuple[float, float, float, float, float]


@compiled(error_model="numpy")
def _level(value: int, levels: int) -> float:
    """Return the position of a channel's value among its bins.

    Bins have their centres at (b + 0.5) * 256 / levels; values outside of the first and last centre
    belong to these bins.
    """
    return min(max((value + 0.5) * (levels / 256.0) - 0.5, 0.0), levels - 1.0)


@compiled(error_model="numpy")
def _share_between_bins(
    image: Image, i: Any, j: Any, levels: int
) -> tuple[tuple[int, int, int, int], tuple[float, float, float, float]]:
    """Return the four bins that share a pixel, and their shares.

    The shares are those of tetrahedral interpolation, as in colour tables: linear and continuous
    like trilinear ones, with half as many bins. From the lower corner of the cell of eight bins
    around the colour, the path goes along the channels in the order of their fractions, the largest
    first. The code has no branches, which a processor could not predict.
    """
    r = _level(image[i, j, 0], levels)
    g = _level(image[i, j, 1], levels)
    b = _level(image[i, j, 2], levels)
    low_r = min(int(r), levels - 2)
    low_g = min(int(g), levels - 2)
    low_b = min(int(b), levels - 2)
    r = r - low_r
    g = g - low_g
    b = b - low_b
    step_r = levels * levels
    step_g = levels
    step_b = 1
    first = step_r if r >= g and r >= b else (step_g if g >= b else step_b)
    last = step_r if r < g and r < b else (step_g if g < b else step_b)
    least = min(min(r, g), b)
    most = max(max(r, g), b)
    middle = max(min(r, g), min(max(r, g), b))
    low = low_r * step_r + low_g * step_g + low_b
    high = low + step_r + step_g + step_b
    bins = low, low + first, high - last, high
    return bins, (1.0 - most, most - middle, middle - least, least)


@compiled(error_model="numpy")
def _cover(
    rx: float, ry: float, half_width: float, half_height: float, scale: float, c: float, s: float
) -> Weight:
    """Return the share of a pixel at r that the template covers, and d cover / d(x, y, theta, ln
    scale).

    With a hard edge, the objective would have a step and a false minimum wherever a pixel's centre
    crosses the edge.
    """
    in_x = scale * (half_width - abs(rx)) + 0.5
    in_y = scale * (half_height - abs(ry)) + 0.5
    if in_x <= 0.0 or in_y <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    cover_x = min(in_x, 1.0)
    cover_y = min(in_y, 1.0)
    slope_x = np.sign(rx) * cover_y if in_x < 1.0 else 0.0
    slope_y = np.sign(ry) * cover_x if in_y < 1.0 else 0.0
    d_x = slope_x * c - slope_y * s
    d_y = slope_x * s + slope_y * c
    d_theta = scale * (slope_y * rx - slope_x * ry)
    d_scale = scale * (abs(slope_x) * half_width + abs(slope_y) * half_height)
    return cover_x * cover_y, d_x, d_y, d_theta, d_scale


@compiled(error_model="numpy")
def _weigh(
    rx: float,
    ry: float,
    cover: Weight,
    value: float,
    gx: float,
    gy: float,
    per_scale: float,
    c: float,
    s: float,
) -> Weight:
    """k and dk/d(x, y, theta, ln scale) of a pixel at r with kernel value k and gradient dk/dr."""
    return (
        value * cover[0],
        value * cover[1] - cover[0] * (gx * c - gy * s) * per_scale,
        value * cover[2] - cover[0] * (gx * s + gy * c) * per_scale,
        value * cover[3] + cover[0] * (gx * ry - gy * rx),
        value * cover[4] - cover[0] * (gx * rx + gy * ry),
    )


@compiled(error_model="numpy")
def _add(rows: Array, b: int, share: float, weight: Weight) -> None:
    """Add a share of a weight to row b (5,)."""
    row = rows[np.uint64(b)]
    row[0] += share * weight[0]
    row[1] += share * weight[1]
    row[2] += share * weight[2]
    row[3] += share * weight[3]
    row[4] += share * weight[4]


@compiled(error_model="numpy")
def kernel_histograms(
    image: Image,
    state: Array,
    half: tuple[float, float],
    centres: Array,
    span: tuple[float, float],
    levels: int,
    stride: int,
) -> tuple[Array, Array]:
    """Un-normalised soft histograms under Epanechnikov kernels, and their derivatives.

    Args:
        image: RGB (H, W, 3).
        state: State (4,).
        half: Half width and height of the template [px]; pixels outside of it do not count.
        centres: Kernel centres in the template (K, 2) [px].
        span: Half axes of the kernels' elliptic support [px].
        levels: Bins per colour channel; each pixel is shared between four neighbours.
        stride: Only every stride-th pixel and row is read.

    Returns:
        sums (K, B, 5): for each kernel and bin the sum of k and of dk/d(x, y, theta, ln scale).
        totals (K, 5): the same over all bins.
    """
    sums = np.zeros((len(centres), levels**3, 5))
    totals = np.zeros((len(centres), 5))
    scale = np.exp(state[3])
    c = np.cos(state[2])
    s = np.sin(state[2])
    per_scale = 1.0 / scale
    per_x = 1.0 / span[0]
    per_y = 1.0 / span[1]
    reach_x = scale * (abs(c) * half[0] + abs(s) * half[1]) + 1.0
    reach_y = scale * (abs(s) * half[0] + abs(c) * half[1]) + 1.0
    first_i = max(0, int(state[1] - reach_y))
    last_i = min(len(image), int(state[1] + reach_y) + 1)
    first_j = max(0, int(state[0] - reach_x))
    last_j = min(image.shape[1], int(state[0] + reach_x) + 1)
    for i in range(first_i, last_i, stride):
        for j in range(first_j, last_j, stride):
            dx = j + 0.5 - state[0]
            dy = i + 0.5 - state[1]
            rx = (c * dx + s * dy) * per_scale
            ry = (c * dy - s * dx) * per_scale
            cover = _cover(rx, ry, half[0], half[1], scale, c, s)
            if cover[0] == 0.0:
                continue
            bins, shares = _share_between_bins(image, np.uint64(i), np.uint64(j), levels)
            for k in range(len(centres)):
                ax = (rx - centres[k, 0]) * per_x
                ay = (ry - centres[k, 1]) * per_y
                value = 1.0 - ax * ax - ay * ay
                if value <= 0.0:
                    continue
                gx = -2.0 * ax * per_x
                gy = -2.0 * ay * per_y
                weight = _weigh(rx, ry, cover, value, gx, gy, per_scale, c, s)
                rows = sums[np.uint64(k)]  # an unsigned index needs no check for negative values
                for corner in range(4):
                    _add(rows, bins[corner], shares[corner], weight)
                for p in range(5):
                    totals[k, p] += weight[p]
    return sums, totals
