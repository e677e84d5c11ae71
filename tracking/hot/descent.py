"""Compiled loops for Levenberg's descent on the SSD of the square roots of histograms."""

import numpy as np

from sim.types import Array, Image
from tracking.hot.compiled import compiled
from tracking.hot.kernel_histograms import kernel_histograms
from tracking.types import LARGEST_LOG

Kernels = tuple[tuple[float, float], Array, tuple[float, float], int, int]
"""Half sides of the template [px], centres (K, 2) and half axes of the kernels [px], bins of
each channel, and the number of pixels above which only every second, third, ... is read."""


FLOOR = 1e-3
"""Added to every bin under the root, whose derivative is infinite at an empty bin."""
TINY = np.finfo(np.float64).tiny
# Levenberg's damping, relative to the trace; chosen by hand, with little effect on the basin.
FIRST_DAMPING = 1e-3
MORE = 8.0
"""Factor after a bad step."""
LESS = 0.2
"""Factor after a good step."""
MOST_DAMPING = 1e3
"""With more damping, steps are too short to matter, and the descent ends."""


@compiled(error_model="numpy")
def histograms(image: Image, x: Array, kernels: Kernels) -> tuple[Array, Array]:
    """Return sums and totals of `kernel_histograms` at x (4,)."""
    half, centres, span, levels, pixels = kernels
    area = 4.0 * half[0] * half[1] * np.exp(2.0 * x[3])
    stride = max(1, int(np.sqrt(area / pixels)))
    return kernel_histograms(image, x, half, centres, span, levels, stride)


@compiled(error_model="numpy")
def ssd_normal_equations(
    sums: Array, totals: Array, root_reference: Array, floor: float
) -> tuple[float, Array, Array]:
    """Cost, gradient (4,) and curvature (4, 4) of mean_k ||sqrt(q_k + floor) - reference_k||^2.

    Args:
        sums: Sums of `kernel_histograms` (K, B, 5).
        totals: Totals of `kernel_histograms` (K, 5).
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


@compiled(error_model="numpy")
def damped_step(gradient: Array, curvature: Array, damping: float, units: Array) -> Array:
    """Levenberg's step (4,): -(H + damping * mean of its diagonal)^-1 g, in the given units.

    Args:
        gradient: Gradient (4,).
        curvature: Curvature (4, 4).
        damping: Damping relative to the mean of the scaled diagonal.
        units: Unit of each coordinate (4,).
    """
    H = np.empty((4, 4))
    g = np.empty(4)
    trace = 0.0
    for p in range(4):
        g[p] = units[p] * gradient[p]
        for r in range(4):
            H[p, r] = curvature[p, r] * units[p] * units[r]
        trace += H[p, p]
    for p in range(4):
        H[p, p] += damping * trace / 4.0 + TINY
    return -units * np.linalg.solve(H, g)


@compiled(error_model="numpy")
def linearise(
    image: Image, x: Array, kernels: Kernels, root_reference: Array
) -> tuple[float, Array, Array]:
    """Cost, gradient (4,) and curvature (4, 4) at x (4,)."""
    sums, totals = histograms(image, x, kernels)
    return ssd_normal_equations(sums, totals, root_reference, FLOOR)


@compiled(error_model="numpy")
def descend(
    image: Image,
    start: Array,
    kernels: Kernels,
    root_reference: Array,
    units: Array,
    most: int,
    tolerance: float,
    hopeless: float,
) -> tuple[Array, float, int]:
    """Descend to the nearest minimum of the cost.

    Args:
        image: RGB (H, W, 3).
        start: First state (4,).
        kernels: Template and kernels.
        root_reference: As for `ssd_normal_equations`.
        units: Unit of each coordinate (4,).
        most: Largest number of evaluations.
        tolerance: A step with all parts below this, in units, is the last; it is not evaluated.
        hopeless: A start with a higher cost is returned unchanged.

    Returns:
        State (4,), the last accepted cost, and the number of evaluations.
    """
    x = start.copy()
    cost, gradient, curvature = linearise(image, x, kernels, root_reference)
    damping = FIRST_DAMPING
    evaluations = 1
    if cost > hopeless:
        return x, cost, evaluations
    while evaluations < most and damping < MOST_DAMPING:
        step = damped_step(gradient, curvature, damping, units)
        there = x + step
        if abs(there[3]) > LARGEST_LOG:
            break
        if np.max(np.abs(step / units)) < tolerance:
            return there, cost, evaluations
        at = linearise(image, there, kernels, root_reference)
        evaluations += 1
        if at[0] < cost:
            x = there
            damping = damping * LESS
            cost, gradient, curvature = at
        else:
            damping *= MORE
    return x, cost, evaluations
