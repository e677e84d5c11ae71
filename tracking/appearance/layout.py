"""Points at which a template is read, grouped in parts (cells of a grid, one ellipse or a ring)
that each have a kernel and a histogram.

A template is read at points that move with the state, not at whole pixels, so that a histogram's
normaliser is a constant, a state costs the same at every scale, and no point of a cell or an
ellipse lies outside the target's rectangle.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.loops import point_histograms as loops
from tracking.types import Region, State

Kernel = Literal["epanechnikov", "linear"]
Combine = Literal["mean", "sum"]
"""Combination of the squared distances of the parts: their mean, or their sum, which assumes that
they are independent."""
TINY = 1e-12
"""Least divisor: it keeps the division by an empty histogram's sum finite."""
LEAST_RING = 8
"""Least number of points along each side of a ring: of fewer, all might lie in the template."""


@dataclass(frozen=True, slots=True)
class Layout:
    """The P points (x, y) at which a template is read, in px from the target's centre at scale 1.
    Each point belongs to one of `count` parts (cells, one ellipse or a ring), and has a kernel
    weight (`weights`, sum 1 in each part) and a weight in a mean-shift step (`pulls`).
    """

    points: Array
    """Template points (P, 2) [px]."""
    parts: NDArray[np.int64]
    """Part of each point (P,)."""
    weights: Array
    """Kernel weight of each point (P,), summing to 1 over a part."""
    radius: float
    """Distance of the farthest point from the centre [px]."""
    count: int
    """Number of parts K."""
    pulls: Array
    """Weight of each point in a mean-shift step (P,): -k'(r^2) of the kernel k, up to a factor."""

    @staticmethod
    def of(
        points: Array, parts: NDArray[np.int64], kernel: Array, pulls: Array | None = None
    ) -> "Layout":
        """Return a layout of points (P, 2) whose kernel weights (P,) are scaled to the sum 1 in
        each part (cell, ellipse or ring).

        Args:
            points: Template points (P, 2) from the target's centre, at scale 1 [px].
            parts: Number of each point's part (P,), 0 to K - 1.
            kernel: Values of the kernel (P,), above 0.
            pulls: Weights in a mean-shift step (P,); None: all 1, as of Epanechnikov's kernel.
        """
        # No point leaves the template: a histogram's normaliser C does not depend on the state.
        mass = np.bincount(parts, kernel)
        radius = float(np.max(np.hypot(points[:, 0], points[:, 1])))
        pulls = np.ones(len(points)) if pulls is None else pulls
        return Layout(points, parts, kernel / mass[parts], radius, len(mass), pulls)


@dataclass(frozen=True, slots=True)
class Sampling:
    """Settings of the points at which a template is read: `density` points along each side of one
    of `cells` x `cells` equal cells, or, with `cells` = None, of one ellipse under the kernel
    `kernel`; and whether the cells' squared distances are combined by their mean or sum.
    """

    density: int = 16
    """Points along each side of a cell, or along the kernel's diameter."""
    cells: int | None = None
    """Cells along each side, under constant kernels; None: one part under `kernel`."""
    kernel: Kernel = "epanechnikov"
    combine: Combine = "mean"

    def layout(self, region: Region, finer: int = 1) -> Layout:
        """Return the points at which the template of a region is read, with their parts and
        weights.

        Args:
            region: The target's rectangle [px].
            finer: Factor on `density`, the number of points along each side of a cell or ellipse.
        """
        density = finer * self.density
        if self.cells is None:
            return disc(region, density, self.kernel)
        return grid(region, self.cells, density)


def lattice(count: int, region: Region) -> Array:
    """Return the centres (count^2, 2), row by row, of count x count equal cells of a region, in px
    from the region's centre.
    """
    at = (np.arange(count) + 0.5) / count - 0.5
    u, v = np.meshgrid(at * region.width, at * region.height)
    return np.stack([u.ravel(), v.ravel()], axis=1)


def grid(region: Region, per_side: int, density: int) -> Layout:
    """Return a layout whose parts are per_side x per_side equal cells of the region, numbered row
    by row, each with density x density points of equal weight.
    """
    steps = per_side * density
    column, row = np.meshgrid(np.arange(steps) // density, np.arange(steps) // density)
    parts = (row * per_side + column).ravel()
    return Layout.of(lattice(steps, region), parts, np.ones(steps**2))


def disc(region: Region, density: int, shape: Kernel = "epanechnikov") -> Layout:
    """Return a layout of one part, the ellipse inscribed in the region. Its points have the weight
    1 - r^2 ("epanechnikov") or 1 - r ("linear"), with r from 0 in the middle to 1 on the ellipse;
    the layout scales the weights to the sum 1.

    The points lie on a lattice of density x density points over the region. Their weights in a
    mean-shift step are equal, or 1 / r for "linear": with equal ones, as in the KAMS paper, a step
    does not climb the Bhattacharyya coefficient of the linear kernel.
    """
    at = (2 * np.arange(density) + 1) / density - 1
    u, v = np.meshgrid(at, at)
    squared = u**2 + v**2
    kernel = 1 - u**2 - v**2 if shape == "epanechnikov" else 1 - np.sqrt(squared)
    inside = kernel > 0  # a point of weight 0 would only cost time
    points = np.stack([u[inside] * region.width / 2, v[inside] * region.height / 2], axis=1)
    pulls = None  # -k' of 1 - r^2 is constant, that of 1 - r is 1 / r
    if shape == "linear":
        pulls = 1 / np.sqrt(np.maximum(squared[inside], 1 / density**2))  # finite in the middle
    return Layout.of(points, np.zeros(len(points), np.int64), kernel[inside], pulls)


def ring(region: Region, width: float, density: int) -> Layout:
    """Return a layout of one part: the points of a rectangle (1 + width) times as wide and high as
    the region, around the same centre, that lie outside the region. The points have equal weights,
    and are those of a lattice of density x density points, at least 8 x 8, over the larger
    rectangle.
    """
    density = max(density, LEAST_RING)
    outer = 1.0 + width
    at = outer * ((np.arange(density) + 0.5) / density - 0.5)
    u, v = np.meshgrid(at, at)
    outside = np.maximum(np.abs(u), np.abs(v)) > 0.5
    points = np.stack([u[outside] * region.width, v[outside] * region.height], axis=1)
    return Layout.of(points, np.zeros(len(points), np.int64), np.ones(len(points)))


def histograms(image: LabelledImage, layout: Layout, state: State) -> Array:
    """Return the histograms (K, B) of the K parts of a layout over B bins, each with the sum 1,
    where the target has the given state in an image.

    Points outside the image or in no bin are left out; a part that has only such points gets zeros.
    """
    vector = state.vector
    window = image.around(vector[None], layout.radius)
    at = (layout.points, layout.parts, layout.weights)
    counts = loops.histograms(window, vector, *at, layout.count, image.bins.count)
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), TINY)
