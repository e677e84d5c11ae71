"""The compiled loops, and nothing else: each has a plain NumPy twin in tests/test_hot.py.

A state is (x, y, theta, ln scale); f_x takes an image point l to the template,
r = R(-theta) (l - (x, y)) / scale. Pixel (i, j) has its centre at (j + 0.5, i + 0.5).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from sim.types import Array, Image

if TYPE_CHECKING:
    from numpy.typing import NDArray

LABELS = "labels outside the window count as no colour"


@numba.njit(cache=True, nogil=True)
def bhattacharyya_of_cells(
    labels: NDArray[Any],
    left: int,
    top: int,
    states: Array,
    points: Array,
    cells: NDArray[Any],
    root_reference: Array,
) -> Array:
    """Bhattacharyya coefficient of each cell of each state (N, K) with its reference histogram.

    Args:
        labels: Bin of each pixel in a window of the image (h, w); negative: not counted as any
            colour.
        left, top: Where the window lies in the image [px].
        states: (N, 4).
        points: Template points at which the image is read (P, 2) [px].
        cells: Cell of each point (P,), 0..K-1.
        root_reference: Square roots of the reference histograms (K, B).
    """
    h, w = labels.shape
    n_states, n_points = len(states), len(points)
    n_cells, n_bins = root_reference.shape
    counts = np.zeros((n_cells, n_bins), np.int64)
    touched = np.empty(n_points, np.int64)
    rho = np.zeros((n_states, n_cells))
    in_cell = np.zeros(n_cells)
    for p in range(n_points):
        in_cell[cells[p]] += 1.0
    for n in range(n_states):
        scale = np.exp(states[n, 3])
        c, s = scale * np.cos(states[n, 2]), scale * np.sin(states[n, 2])
        x0, y0 = states[n, 0] - left, states[n, 1] - top
        for p in range(n_points):
            touched[p] = -1
            u = x0 + c * points[p, 0] - s * points[p, 1]
            v = y0 + s * points[p, 0] + c * points[p, 1]
            if 0.0 <= u < w and 0.0 <= v < h:
                label = labels[int(v), int(u)]
                if label >= 0:
                    touched[p] = label
                    counts[cells[p], label] += 1
        for p in range(n_points):
            label = touched[p]
            if label >= 0:
                k = cells[p]
                if counts[k, label] > 0:
                    rho[n, k] += root_reference[k, label] * np.sqrt(counts[k, label] / in_cell[k])
                    counts[k, label] = 0
    return rho


@numba.njit(cache=True, nogil=True)
def kernel_histograms(
    image: Image,
    state: Array,
    half_width: float,
    half_height: float,
    centres: Array,
    span_x: float,
    span_y: float,
    levels: int,
    stride: int,
) -> tuple[Array, Array]:
    """Un-normalised soft histograms under Epanechnikov kernels, and their derivatives.

    Args:
        image: RGB (H, W, 3).
        state: (4,).
        half_width, half_height: The template; a pixel outside it is not seen by any kernel [px].
        centres: Kernel centres in the template (K, 2) [px].
        span_x, span_y: Half axes of the kernels' elliptic support [px].
        levels: Bins per colour channel; each pixel is shared trilinearly between its neighbours.
        stride: Every stride-th pixel and line is read.

    Returns:
        sums (K, B, 5): for each kernel and bin the sum of k and of dk/d(x, y, theta, ln scale).
        totals (K, 5): the same over all bins.
    """
    height, width = image.shape[:2]
    n_kernels = len(centres)
    sums = np.zeros((n_kernels, levels**3, 5))
    totals = np.zeros((n_kernels, 5))
    scale = np.exp(state[3])
    c, s = np.cos(state[2]), np.sin(state[2])
    reach_x = scale * (abs(c) * half_width + abs(s) * half_height) + 1.0
    reach_y = scale * (abs(s) * half_width + abs(c) * half_height) + 1.0
    first_i, last_i = max(0, int(state[1] - reach_y)), min(height, int(state[1] + reach_y) + 1)
    first_j, last_j = max(0, int(state[0] - reach_x)), min(width, int(state[0] + reach_x) + 1)
    bins = np.empty(8, np.int64)
    shares = np.empty(8)
    low = np.empty(3, np.int64)
    part = np.empty(3)
    for i in range(first_i, last_i, stride):
        for j in range(first_j, last_j, stride):
            dx, dy = j + 0.5 - state[0], i + 0.5 - state[1]
            rx, ry = (c * dx + s * dy) / scale, (-s * dx + c * dy) / scale
            # A pixel counts by how much of it the template covers. With a hard rim the objective
            # would have a step, and a false minimum, wherever a pixel's centre crosses it.
            in_x, in_y = scale * (half_width - abs(rx)) + 0.5, scale * (half_height - abs(ry)) + 0.5
            if in_x <= 0.0 or in_y <= 0.0:
                continue
            cover_x, cover_y = min(in_x, 1.0), min(in_y, 1.0)
            slope_x = np.sign(rx) * cover_y if in_x < 1.0 else 0.0
            slope_y = np.sign(ry) * cover_x if in_y < 1.0 else 0.0
            cover = cover_x * cover_y
            m_x = slope_x * c - slope_y * s
            m_y = slope_x * s + slope_y * c
            m_theta = scale * (slope_y * rx - slope_x * ry)
            m_scale = scale * (abs(slope_x) * half_width + abs(slope_y) * half_height)
            for channel in range(3):
                # Bin centres lie at (b + 0.5) * 256 / levels; colours beyond the last one stay in
                # it.
                level = (image[i, j, channel] + 0.5) * levels / 256.0 - 0.5
                level = min(max(level, 0.0), levels - 1.0)
                low[channel] = min(int(level), levels - 2)
                part[channel] = level - low[channel]
            for corner in range(8):
                label, share = 0, 1.0
                for channel in range(3):
                    up = (corner >> channel) & 1
                    label = label * levels + low[channel] + up
                    share *= part[channel] if up else 1.0 - part[channel]
                bins[corner] = label
                shares[corner] = share
            for k in range(n_kernels):
                ax, ay = (rx - centres[k, 0]) / span_x, (ry - centres[k, 1]) / span_y
                value = 1.0 - ax * ax - ay * ay
                if value <= 0.0:
                    continue
                gx, gy = -2.0 * ax / span_x, -2.0 * ay / span_y
                d_x = value * m_x - cover * (gx * c - gy * s) / scale
                d_y = value * m_y - cover * (gx * s + gy * c) / scale
                d_theta = value * m_theta + cover * (gx * ry - gy * rx)
                d_scale = value * m_scale - cover * (gx * rx + gy * ry)
                value *= cover
                for corner in range(8):
                    share = shares[corner]
                    if share > 0.0:
                        row = sums[k, bins[corner]]
                        row[0] += share * value
                        row[1] += share * d_x
                        row[2] += share * d_y
                        row[3] += share * d_theta
                        row[4] += share * d_scale
                totals[k, 0] += value
                totals[k, 1] += d_x
                totals[k, 2] += d_y
                totals[k, 3] += d_theta
                totals[k, 4] += d_scale
    return sums, totals


@numba.njit(cache=True, nogil=True)
def ssd_normal_equations(
    sums: Array, totals: Array, root_reference: Array, floor: float
) -> tuple[float, Array, Array]:
    """Cost, gradient (4,) and curvature (4, 4) of mean_k ||sqrt(q_k + floor) - reference_k||^2.

    Args:
        sums: As of kernel_histograms (K, B, 5).
        totals: As of kernel_histograms (K, 5).
        root_reference: Square roots of the reference histograms plus floor (K, B).
        floor: Added to every bin under the root.
    """
    n_kernels, n_bins = root_reference.shape
    cost = 0.0
    gradient = np.zeros(4)
    curvature = np.zeros((4, 4))
    row = np.empty(4)
    root_floor = np.sqrt(floor)
    for k in range(n_kernels):
        total = max(totals[k, 0], 1e-12)
        for b in range(n_bins):
            mass = sums[k, b, 0]
            if mass == 0.0:
                e = root_floor - root_reference[k, b]
                cost += e * e
                continue
            q = mass / total
            root = np.sqrt(q + floor)
            e = root - root_reference[k, b]
            cost += e * e
            for p in range(4):
                row[p] = (sums[k, b, 1 + p] - q * totals[k, 1 + p]) / (2.0 * total * root)
            for p in range(4):
                gradient[p] += row[p] * e
                for r in range(p + 1):
                    curvature[p, r] += row[p] * row[r]
    for p in range(4):
        for r in range(p):
            curvature[r, p] = curvature[p, r]
    return cost / n_kernels, gradient / n_kernels, curvature / n_kernels
