"""Compiled loops: direct alignment of a plane by Gauss-Newton steps, inverse compositional
(Baker, Matthews, Lucas-Kanade 20 years on, 2004).

A point x of the template, in a unit square from -0.5 to 0.5, is seen at H x [px]; the pixel in row
i and column j has its centre at (j + 0.5, i + 0.5).
"""

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array
from tracking.loops.descent import solved

Template = tuple[Array, Array, Array, NDArray[np.intp]]
"""Points (n, 2) of a template, its brightness there (n,), derivatives (n, 8), and the cells (n,) of
the points."""
TUKEY = 4.685
"""Number of robust standard deviations from which on residuals have no weight: the usual constant,
with 95 % efficiency for normal residuals."""
QUANTILE = 0.35
"""Quantile of the residuals' sizes that gives the standard deviation: the median would grow with an
object that hides a third of the target."""
NORMAL = 0.4538
"""Quantile `QUANTILE` of the sizes of normal residuals of standard deviation 1."""
# The numbers below were chosen by hand on rendered plates with a part hidden (tracking/RESULTS.md).
LEAST_SIGMA = 1.0
"""Least standard deviation of the residuals [grey levels]."""
USUAL = 0.8
"""Mean Tukey weight, 0..1, of the points where nothing hides the template."""
HIDDEN = 0.3
"""Mean weight below which a cell of the template counts as hidden."""
SHOWN = 0.6
"""Mean weight above which a cell counts as seen."""
LARGEST_STEP = 0.7
"""Largest step of a descent that has not failed [sides of the template]."""
LARGEST_GAIN = 10.0
"""Largest gain of the brightness; the smallest is its inverse."""
LEAST_SEEN = 0.4
"""Least share of the template's points that must lie in the picture."""
FEWEST = 12
"""Least number of points in the picture: ten parameters are sought."""


@compiled(error_model="numpy")
def sample(image: NDArray[np.float32], H: Array, points: Array) -> Array:
    """Return the brightness (n,) of a picture (height, width) at the places [px] to which the
    homography H (3, 3) maps points (n, 2).

    It is interpolated bilinearly, and nan outside the picture and behind the camera.
    """
    height, width = image.shape
    seen = np.empty(len(points))
    for i in range(len(points)):
        x = points[i, 0]
        y = points[i, 1]
        w = H[2, 0] * x + H[2, 1] * y + H[2, 2]
        u = (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / w - 0.5
        v = (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / w - 0.5
        if not (w > 0.0 and u >= 0.0 and v >= 0.0 and u < width - 1 and v < height - 1):
            seen[i] = np.nan
            continue
        j = int(u)
        k = int(v)
        a = u - j
        b = v - k
        seen[i] = (1 - b) * ((1 - a) * image[k, j] + a * image[k, j + 1]) + b * (
            (1 - a) * image[k + 1, j] + a * image[k + 1, j + 1]
        )
    return seen


@compiled(error_model="numpy")
def partition(values: Array, rank: int) -> None:
    """Reorder values (n,) in place so that the value at index `rank` is the one of the sorted
    array, with no larger value before it and no smaller one after it (Hoare's quickselect).

    Numba takes five times as long to compile NumPy's `quantile` and `partition`.
    """
    low = 0
    high = len(values) - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i = low
        j = high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        # Now values up to j are at most the pivot, those from i on at least; between is the pivot.
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            return


@compiled(error_model="numpy")
def sigma_of(error: Array) -> float:
    """Return a robust standard deviation of errors (n,) [grey levels]: the 35 % quantile of their
    sizes over that of normal errors, or 1 if it is smaller. Errors of nan are left out; at least
    two must not be nan.
    """
    size = np.abs(error[~np.isnan(error)])
    rank = 1.0 + (len(size) - 1) * QUANTILE  # counted from 1, as NumPy's `quantile` rounds it
    below = int(rank)
    partition(size, below - 1)
    share = rank - below
    quantile = size[below - 1] * (1.0 - share) + size[below:].min() * share
    return max(quantile / NORMAL, LEAST_SIGMA)


@compiled(error_model="numpy")
def tukey(error: Array, sigma: float) -> Array:
    """Return Tukey's biweights (n,), 0..1, of errors (n,) with the standard deviation `sigma`: 1
    for an error of 0, 0 from 4.685 sigma on and for nan.
    """
    limit = TUKEY * sigma
    weights = np.zeros(len(error))
    for i in range(len(error)):
        # An error of nan, outside the picture, is not below the limit.
        if abs(error[i]) < limit:
            weights[i] = (1.0 - (error[i] / limit) ** 2) ** 2
    return weights


@compiled(error_model="numpy")
def agreed(weights: Array, cells: NDArray[np.intp]) -> Array:
    """Return the weights (n,) of points, times a factor that falls from 1 to 0 as the mean weight
    of the points in the same cell of the template falls from 0.6 to 0.3.

    An object that hides the target hides whole cells, in which some points fit by chance.

    Args:
        weights: Weights of the points (n,), 0..1.
        cells: Number of each point's cell (n,).
    """
    mean = (np.bincount(cells, weights) / np.bincount(cells))[cells]
    return weights * np.minimum(np.maximum((mean - HIDDEN) / (SHOWN - HIDDEN), 0.0), 1.0)


@compiled(error_model="numpy")
def normal_equations(
    error: Array, weights: Array, rows: Array, template: Array, gain: float
) -> tuple[Array, Array]:
    """Return curvature (10, 10) and negative gradient (10,) of half the sum of weighted squared
    errors, by the eight parameters of a step of the template, gain and bias. The curvature, that of
    Gauss-Newton, has a slightly enlarged diagonal, so that it can be inverted where the visible
    part has no texture.

    Args:
        error: Errors (n,) [grey levels]: picture minus gain times template minus bias.
        weights: Weights (n,); a point of weight 0 may have the error nan.
        rows: Derivatives (n, 8) of the template's brightness by the parameters.
        template: Brightness of the template (n,) [grey levels].
        gain: Current gain.
    """
    A = np.zeros((10, 10))
    g = np.zeros(10)
    row = np.empty(10)
    for i in range(len(error)):
        w = weights[i]
        if w == 0.0:  # hidden, or outside the picture, where the error is nan
            continue
        for p in range(8):
            row[p] = gain * rows[i, p]
        row[8] = template[i]
        row[9] = 1.0
        for p in range(10):
            g[p] += w * row[p] * error[i]
            for q in range(p + 1):
                A[p, q] += w * row[p] * row[q]
    for p in range(10):
        for q in range(p):
            A[q, p] = A[p, q]
        # A little damping keeps A regular where the visible part has no texture.
        A[p, p] = A[p, p] * (1.0 + 1e-9) + 1e-6
    return A, g


@compiled(error_model="numpy")
def correlation(seen: Array, template: Array, weights: Array) -> float:
    """Return the weighted correlation, -1..1, of the brightness seen in a picture (n,) and that of
    the template (n,), at the points with a weight above 0.

    If the mean of all weights (n,) is below 0.8, the correlation is multiplied by this mean over
    0.8, because only a part fits.
    """
    total = 1e-12
    mean = 0.0
    expected = 0.0
    for i in range(len(seen)):
        if weights[i] > 0.0:
            total += weights[i]
            mean += weights[i] * seen[i]
            expected += weights[i] * template[i]
    mean = mean / total
    expected = expected / total
    own = 1e-12
    known = 1e-12
    shared = 0.0
    for i in range(len(seen)):
        if weights[i] > 0.0:
            a = seen[i] - mean
            b = template[i] - expected
            own += weights[i] * a * a
            known += weights[i] * b * b
            shared += weights[i] * a * b
    return shared / np.sqrt(own * known) * min(1.0, total / (USUAL * len(seen)))


@compiled(error_model="numpy")
def misfit(weights: Array, sigma: float, spread: float) -> float:
    """Return the mean over all points of the logarithm of a standard deviation [grey levels]:
    `sigma` for visible points, and the larger of `spread` and `sigma` for hidden ones. The share of
    visible points is the mean weight over 0.8, at most 1.

    Args:
        weights: Weights of the points (n,), 0..1.
        sigma: Standard deviation of the visible points [grey levels].
        spread: Standard deviation of the template's brightness [grey levels], which hidden points
            are assumed to have.
    """
    # So an alignment is better if more is seen, or if it fits better: neither alone decides.
    seen = min(1.0, weights.sum() / (USUAL * len(weights)))
    return seen * np.log(sigma) + (1.0 - seen) * np.log(max(spread, sigma))


@compiled(error_model="numpy")
def moved_back(H: Array, d: Array) -> Array:
    """Return a homography H (3, 3) times the inverse of the step with the parameters d (8,), scaled
    so that its last element is 1.

    The step is one of the template, and so its inverse moves the picture (inverse compositional).
    The sums have a fixed order: those of BLAS and LAPACK differ between processors.
    """
    # The step is the matrix [a b c; e f g; h i 1].
    a = 1.0 + d[0]
    b = d[1]
    c = d[2]
    e = d[3]
    f = 1.0 + d[4]
    g = d[5]
    h = d[6]
    i = d[7]
    # Its inverse but for the scale (adjugate matrix); the scale ends in the last line.
    inverse = np.array(
        [
            [f - g * i, c * i - b, b * g - c * f],
            [g * h - e, a - c * h, c * e - a * g],
            [e * i - f * h, b * h - a * i, a * f - b * e],
        ]
    )
    at = np.zeros((3, 3))
    for row in range(3):
        for column in range(3):
            for k in range(3):
                at[row, column] += H[row, k] * inverse[k, column]
    return at / at[2, 2]


@compiled(error_model="numpy")
def align(
    image: NDArray[np.float32],
    begin: Array,
    light: Array,
    level: Template,
    most: int,
    tolerance: float,
) -> tuple[Array, Array, float, float]:
    """Find, by Gauss-Newton steps, the homography H (3, 3) with I(H x) = gain T(x) + bias for the
    points x of a template, with I the brightness of the picture.

    Args:
        image: Brightness I (height, width) [grey levels].
        begin: H at first, from the template's unit square to pixels.
        light: Gain and bias [grey levels] at first.
        level: The template: points x (m, 2) in a unit square, their brightness T (m,), its
            derivatives by the eight parameters of H (m, 8), and the numbers of the points' cells
            (m,).
        most: Largest number of steps.
        tolerance: Length of a step that ends the descent [sides of the template].

    Returns:
        H; gain and bias (2,); the correlation, -1..1; and the misfit, as the function `misfit`
        returns it. Where the template left the picture or the descent failed, the correlation is 0,
        the misfit inf, and gain and bias are those given.
    """
    points, template, rows, cells = level
    at = begin
    gain = light[0]
    bias = light[1]
    k = 0
    while True:
        seen = sample(image, at, points)
        if (~np.isnan(seen)).sum() < max(LEAST_SEEN * len(seen), FEWEST):
            return at, light, 0.0, np.inf
        error = seen - gain * template - bias
        sigma = sigma_of(error)
        weights = agreed(tukey(error, sigma), cells)
        if k >= most:
            alike = correlation(seen, template, weights)
            spread = gain * np.std(template)
            return at, np.array([gain, bias]), alike, misfit(weights, sigma, spread)
        A, g = normal_equations(error, weights, rows, template, gain)
        d = solved(A, g)
        size = np.max(np.abs(d[:8]))
        if not size < LARGEST_STEP:
            return at, light, 0.0, np.inf
        gain = min(max(gain + d[8], 1.0 / LARGEST_GAIN), LARGEST_GAIN)
        bias = bias + d[9]
        at = moved_back(at, d)
        k = most if size < tolerance else k + 1
