"""Compiled loops of a search for the target's state: Levenberg's descent minimises the squared
differences between the square roots of the histograms at a state and of the target's reference
histograms. Histograms count pixels under Epanechnikov kernels.

A state is x, y [px], theta [rad], ln scale; f_x maps an image point l into the template, r =
R(-theta) (l - (x, y)) / scale. Pixel (i, j) has its centre at (j + 0.5, i + 0.5).
"""

import numpy as np

from sim.compiled import compiled
from sim.types import Array, Image
from tracking.types import LARGEST_LOG

Kernels = tuple[tuple[float, float], Array, tuple[float, float], int, int]
"""Half sides of the template [px], centres (K, 2) and half axes of the kernels [px], number of bins
of each channel, and the number of pixels above which only every second, third, ... is read."""
Weight = tuple[float, float, float, float, float]
"""A pixel's weight under a kernel, and its derivatives by (x, y, theta, ln scale)."""
FLOOR = 1e-3
"""Number added to every bin before the root is taken, whose derivative is infinite at 0."""
TINY = np.finfo(np.float64).tiny
# Levenberg's damping, relative to the trace; chosen by hand, with little effect on the basin.
FIRST_DAMPING = 1e-3
"""Damping of the first step."""
MORE = 8.0
"""Factor on the damping after a step that raised the cost."""
LESS = 0.2
"""Factor on the damping after a step that lowered the cost."""
MOST_DAMPING = 1e3
"""Damping that ends the descent: its steps are too short to matter."""


@compiled(error_model="numpy")
def _level(value: int, levels: int) -> float:
    """Return the position of a channel's value, 0..255, among its bins, 0..levels - 1.

    Bins have their centres at (b + 0.5) * 256 / levels; values outside of the first and last centre
    belong to these bins.
    """
    return min(max((value + 0.5) * (levels / 256.0) - 0.5, 0.0), levels - 1.0)


@compiled(error_model="numpy")
def _share_between_bins(
    image: Image, i: np.uint64, j: np.uint64, levels: int
) -> tuple[tuple[int, int, int, int], tuple[float, float, float, float]]:
    """Return the numbers of the four bins that share the pixel in row i and column j, and their
    shares, which sum to 1.

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
    rx: float, ry: float, half: tuple[float, float], scale: float, c: float, s: float, stride: int
) -> Weight:
    """Return the share, 0..1, of a square around r = (rx, ry) [template px] that the template
    covers, and its derivatives by (x, y, theta, ln scale). The square's side is the distance
    between the pixels that are read, `stride` [px].

    With a hard edge, the objective would have a step and a false minimum wherever a pixel's centre
    crosses the edge; with squares smaller than that distance, wherever the edge lies between them.
    """
    in_x = scale * (half[0] - abs(rx)) / stride + 0.5
    in_y = scale * (half[1] - abs(ry)) / stride + 0.5
    if in_x <= 0.0 or in_y <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    cover_x = min(in_x, 1.0)
    cover_y = min(in_y, 1.0)
    slope_x = np.sign(rx) * cover_y / stride if in_x < 1.0 else 0.0
    slope_y = np.sign(ry) * cover_x / stride if in_y < 1.0 else 0.0
    d_x = slope_x * c - slope_y * s
    d_y = slope_x * s + slope_y * c
    d_theta = scale * (slope_y * rx - slope_x * ry)
    d_scale = scale * (abs(slope_x) * half[0] + abs(slope_y) * half[1])
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
    """Return the weight k of a pixel at r = (rx, ry) under a kernel, and its derivatives by (x, y,
    theta, ln scale).

    Args:
        rx: The pixel's place in the template, along its width [px].
        ry: The same along its height [px].
        cover: The share of the pixel's square that the template covers, with its derivatives.
        value: Value of the kernel at r.
        gx: Derivative of the kernel by rx [1/px].
        gy: Derivative of the kernel by ry [1/px].
        per_scale: Inverse of the scale.
        c: Cosine of theta.
        s: Sine of theta.
    """
    return (
        value * cover[0],
        value * cover[1] - cover[0] * (gx * c - gy * s) * per_scale,
        value * cover[2] - cover[0] * (gx * s + gy * c) * per_scale,
        value * cover[3] + cover[0] * (gx * ry - gy * rx),
        value * cover[4] - cover[0] * (gx * rx + gy * ry),
    )


@compiled(error_model="numpy")
def _add(rows: Array, b: int, share: float, weight: Weight) -> None:
    """Add a share, 0..1, of a weight and its derivatives to row b of rows (B, 5)."""
    row = rows[np.uint64(b)]
    for p in range(5):
        row[p] += share * weight[p]


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
    """Return soft histograms under Epanechnikov kernels and their derivatives, not normalised.

    Args:
        image: RGB (H, W, 3).
        state: x, y [px], theta [rad], ln scale (4,).
        half: Half width and height of the template [px]; pixels outside of it do not count.
        centres: Kernel centres in the template (K, 2) [px].
        span: Half axes of the kernels' elliptic support [px].
        levels: Bins per colour channel; each pixel is shared between four neighbours.
        stride: Only every stride-th pixel and row is read.

    Returns:
        sums (K, B, 5): for each kernel and bin the sums of the pixels' weights k and of their
            derivatives by x, y, theta and ln scale.
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
    reach_x = scale * (abs(c) * half[0] + abs(s) * half[1]) + stride
    reach_y = scale * (abs(s) * half[0] + abs(c) * half[1]) + stride
    # The upright box around the turned template bounds the pixels that are read. Which pixels of
    # the picture are read does not depend on the state, else the objective would have steps.
    first_i = max(0, int(state[1] - reach_y)) // stride * stride
    last_i = min(len(image), int(state[1] + reach_y) + 1)
    first_j = max(0, int(state[0] - reach_x)) // stride * stride
    last_j = min(image.shape[1], int(state[0] + reach_x) + 1)
    for i in range(first_i, last_i, stride):
        for j in range(first_j, last_j, stride):
            dx = j + 0.5 - state[0]
            dy = i + 0.5 - state[1]
            rx = (c * dx + s * dy) * per_scale
            ry = (c * dy - s * dx) * per_scale
            cover = _cover(rx, ry, half, scale, c, s, stride)
            if cover[0] == 0.0:
                continue
            bins, shares = _share_between_bins(image, np.uint64(i), np.uint64(j), levels)
            # Kernels overlap where their span exceeds a cell: a pixel may count in several.
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


@compiled(error_model="numpy")
def stride_for(x: Array, kernels: Kernels) -> int:
    """Return n, so that every n-th pixel and row of a template at state x (4,) is about the largest
    number of pixels that is to be read; 1 for small templates.
    """
    half, _, _, _, pixels = kernels
    area = 4.0 * half[0] * half[1] * np.exp(2.0 * x[3])
    return max(1, int(np.sqrt(area / pixels)))


@compiled(error_model="numpy")
def histograms(image: Image, x: Array, kernels: Kernels, stride: int) -> tuple[Array, Array]:
    """Return the sums (K, B, 5) and totals (K, 5) of `kernel_histograms`: for K kernels and B bins,
    the pixels' weights and their derivatives by x, y [px], theta [rad] and ln scale.

    Args:
        image: RGB (H, W, 3).
        x: State (4,): x, y [px], theta [rad], ln scale.
        kernels: Half sides of the template [px], centres and half axes of the kernels [px], number
            of bins of each channel, and largest number of pixels read, about.
        stride: Only every stride-th pixel and row is read.
    """
    half, centres, span, levels, _ = kernels
    return kernel_histograms(image, x, half, centres, span, levels, stride)


@compiled(error_model="numpy")
def ssd_normal_equations(
    sums: Array, totals: Array, root_reference: Array, floor: float
) -> tuple[float, Array, Array]:
    """Return cost, gradient (4,) and curvature (4, 4), by x, y, theta and ln scale, of mean_k
    ||sqrt(q_k + floor) - q*_k||^2, with q_k the normalised histogram of kernel k.

    The curvature is that of Gauss-Newton, J' J: second derivatives are left out. Gradient and
    curvature lack their common factor 2.

    Args:
        sums: Sums of `kernel_histograms` (K, B, 5).
        totals: Totals of `kernel_histograms` (K, 5).
        root_reference: q*_k, square roots (K, B) of the sums of reference histograms and `floor`.
        floor: Number added to every bin before the root is taken.
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
            if mass == 0.0:  # most bins: no derivative
                e = root_floor - root_reference[k, b]
                cost += e * e
                continue
            q = mass / total
            root = np.sqrt(q + floor)
            e = root - root_reference[k, b]
            cost += e * e
            # d sqrt(q + floor) / dp with q = mass / total, where total depends on p, too.
            for p in range(4):
                row[p] = (sums[k, b, 1 + p] - q * totals[k, 1 + p]) / (2.0 * total * root)
            for p in range(4):
                gradient[p] += row[p] * e
                for r in range(p + 1):
                    curvature[p, r] += row[p] * row[r]
    for p in range(4):
        gradient[p] /= n_kernels
        for r in range(p + 1):
            curvature[p, r] /= n_kernels
            curvature[r, p] = curvature[p, r]
    return cost / n_kernels, gradient, curvature


@compiled(error_model="numpy", fastmath={"contract"})
def solved(A: Array, b: Array) -> Array:
    """Return the solution x (n,) of A x = b. Both arguments are changed: x is written into b, which
    is returned, and A (n, n) becomes its factors. A singular A gives inf or nan.

    Crout's elimination with row exchanges, in LAPACK's order of operations. NumPy's `solve` takes
    as long to compile as all other loops.
    """
    n = len(b)
    for j in range(n):
        for i in range(n):
            known = 0.0
            for k in range(min(i, j)):
                known += A[i, k] * A[k, j]
            A[i, j] -= known
        best = j
        for i in range(j + 1, n):
            if abs(A[i, j]) > abs(A[best, j]):
                best = i
        for k in range(n):
            A[j, k], A[best, k] = A[best, k], A[j, k]
        b[j], b[best] = b[best], b[j]
        share = 1.0 / A[j, j]
        for i in range(j + 1, n):
            A[i, j] *= share
            b[i] -= b[j] * A[i, j]
    for j in range(n - 1, -1, -1):
        b[j] /= A[j, j]
        for i in range(j):
            b[i] -= b[j] * A[i, j]
    return b


@compiled(error_model="numpy")
def damped_step(gradient: Array, curvature: Array, damping: float, units: Array) -> Array:
    """Return Levenberg's step (4,) of x, y [px], theta [rad] and ln scale: -(H + damping * mean of
    H's diagonal * identity)^-1 g, with curvature H and gradient g, computed with each coordinate
    divided by its unit.

    Args:
        gradient: Gradient g (4,).
        curvature: Curvature H (4, 4).
        damping: Damping relative to the mean of the scaled diagonal.
        units: Unit of each coordinate (4,), by which the damping weighs the coordinates.
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
        H[p, p] += damping * trace / 4.0 + TINY  # regular also where the picture has one colour
    step = solved(H, g)
    for p in range(4):
        step[p] *= -units[p]
    return step


@compiled(error_model="numpy")
def linearise(
    image: Image, x: Array, kernels: Kernels, root_reference: Array, stride: int
) -> tuple[float, Array, Array]:
    """Return cost, gradient (4,) and curvature (4, 4), by x, y [px], theta [rad] and ln scale, of
    the squared difference mean_k ||sqrt(q_k + 0.001) - q*_k||^2 at a state, where q_k is the
    histogram of kernel k; as `ssd_normal_equations` returns them, without the factor 2.

    Args:
        image: RGB (H, W, 3).
        x: State (4,): x, y [px], theta [rad], ln scale.
        kernels: Half sides of the template [px], centres and half axes of the kernels [px], number
            of bins of each channel, and largest number of pixels read, about.
        root_reference: Square roots q*_k of the reference histograms plus 0.001 (K, B).
        stride: Only every stride-th pixel and row is read.
    """
    sums, totals = histograms(image, x, kernels, stride)
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
    """Descend from a state to a local minimum of the cost mean_k ||sqrt(q_k + 0.001) - q*_k||^2, by
    Levenberg's steps; q_k is the histogram of kernel k at the state.

    Args:
        image: RGB (H, W, 3).
        start: First state (4,): x, y [px], theta [rad], ln scale.
        kernels: Half sides of the template [px], centres and half axes of the kernels [px], number
            of bins of each channel, and largest number of pixels read, about.
        root_reference: q*_k, square roots (K, B) of the sums of reference histograms and 0.001.
        units: Unit of each coordinate of a state (4,), by which steps are damped and judged.
        most: Largest number of evaluations.
        tolerance: A step with all coordinates below this, in `units`, is the last; it is taken
            without an evaluation.
        hopeless: A start with a higher cost is returned unchanged.

    Returns:
        State (4,), the cost at the last state that was evaluated and accepted, and the number of
        evaluations.
    """
    x = start.copy()
    stride = stride_for(start, kernels)  # the same all the way: costs are compared
    cost, gradient, curvature = linearise(image, x, kernels, root_reference, stride)
    damping = FIRST_DAMPING
    evaluations = 1
    if cost > hopeless:  # too far from the target: a descent would end in clutter
        return x, cost, evaluations
    while evaluations < most and damping < MOST_DAMPING:
        step = damped_step(gradient, curvature, damping, units)
        there = x + step
        if abs(there[3]) > LARGEST_LOG:
            break
        is_last = True
        for p in range(4):
            is_last &= abs(step[p] / units[p]) < tolerance
        if is_last:  # right without an evaluation, so near the minimum
            return there, cost, evaluations
        at = linearise(image, there, kernels, root_reference, stride)
        evaluations += 1
        if at[0] < cost:
            x = there
            damping = damping * LESS
            cost, gradient, curvature = at
        else:
            damping *= MORE
    return x, cost, evaluations
