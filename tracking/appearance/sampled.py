"""Histograms of a target read at fixed template points, under one kernel or many.

With the template cut into cells this is the multiple-kernel representation of the particle filter
(Teuliere, Marchand, Eck, sections II and IV-B); with one Epanechnikov disc it is that of mean shift
(Comaniciu, Ramesh, Meer 2003) and of the single-kernel filters. The paper's lost equations (1) to
(5), as we read them:

    f_x(l)  = R(-theta) (l - (x, y)) / s                       the image in template coordinates
    q_u(x)  = C sum_i K(f_x(l_i) - c) delta[b(l_i) - u]        histogram, sums to 1
    rho(x)  = sum_u sqrt(q*_u q_u(x))                          Bhattacharyya coefficient
    d_m(x)  = sqrt(1 - mean_j rho_j(x))                        over the parts j

The distance is the mean over the nine parts, not the sum: the sum is the same likelihood with nine
times gamma, under which 300 particles leave an effective sample of two.

The template is read at points that every state carries along, not at whole pixels, so that C is a
constant, a state costs the same at every scale, and no point lies outside the object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking.appearance.bins import Bins, Window
from tracking.hot import sampled as hot
from tracking.types import Region, State

TINY = 1e-12
LEAST_RING = 8
"""Points along each side of a ring: with fewer, none might lie outside the template."""
REFERENCE_DENSITY = 4
"""The reference is read this much more densely a side, so that it does not depend on the pixel
grid.
"""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where a template is read, which part each point belongs to, and what it weighs."""

    points: Array
    """Template points (P, 2) [px]."""
    parts: NDArray[np.int64]
    """Part of each point (P,)."""
    weights: Array
    """Kernel weight of each point (P,), summing to 1 over a part."""

    @staticmethod
    def of(points: Array, parts: NDArray[np.int64], kernel: Array) -> Layout:
        """A layout with the kernel's values (P,) normalised over each part."""
        return Layout(points, parts, kernel / np.bincount(parts, kernel)[parts])

    @property
    def radius(self) -> float:
        """Distance of the farthest point from the centre [px]."""
        return float(np.max(np.hypot(self.points[:, 0], self.points[:, 1])))


def grid(region: Region, per_side: int, density: int) -> Layout:
    """The template cut into per_side^2 equal parts: constant kernels, density^2 points in each."""
    steps = per_side * density
    at = (np.arange(steps) + 0.5) / steps - 0.5
    u, v = np.meshgrid(at, at)
    column, row = np.meshgrid(np.arange(steps) // density, np.arange(steps) // density)
    points = np.stack([u.ravel() * region.width, v.ravel() * region.height], axis=1)
    return Layout.of(points, (row * per_side + column).ravel(), np.ones(len(points)))


def disc(region: Region, density: int) -> Layout:
    """One part: the ellipse in the template, under an Epanechnikov kernel."""
    at = (2 * np.arange(density) + 1) / density - 1
    u, v = np.meshgrid(at, at)
    kernel = 1 - u**2 - v**2
    inside = kernel > 0
    points = np.stack([u[inside] * region.width / 2, v[inside] * region.height / 2], axis=1)
    return Layout.of(points, np.zeros(len(points), np.int64), kernel[inside])


def ring(region: Region, width: float, density: int) -> Layout:
    """One part: the frame around the template, out to (1 + width) times its size."""
    outer = 1.0 + width
    at = outer * ((np.arange(density) + 0.5) / density - 0.5)
    u, v = np.meshgrid(at, at)
    outside = np.maximum(np.abs(u), np.abs(v)) > 0.5
    points = np.stack([u[outside] * region.width, v[outside] * region.height], axis=1)
    return Layout.of(points, np.zeros(len(points), np.int64), np.ones(len(points)))


def histograms(image: Image, bins: Bins, layout: Layout, state: State) -> Array:
    """Normalised histograms (K, B) of the parts of a layout; points off the image are left out."""
    vector = state.vector[None]
    window = Window.around(vector, layout.radius, image)
    labels = bins.label(image, window)
    c, s = state.scale * np.cos(state.theta), state.scale * np.sin(state.theta)
    turned = layout.points @ np.array([[c, s], [-s, c]])
    column = np.floor(turned[:, 0] + state.x).astype(int) - window.left
    row = np.floor(turned[:, 1] + state.y).astype(int) - window.top
    inside = (column >= 0) & (column < labels.shape[1]) & (row >= 0) & (row < labels.shape[0])
    counts = np.zeros((int(layout.parts.max()) + 1, bins.count))
    seen = labels[row[inside], column[inside]].astype(np.int64)
    counted = seen >= 0
    at = (layout.parts[inside][counted], seen[counted])
    np.add.at(counts, at, layout.weights[inside][counted])
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), TINY)


class SampledModel:
    """The target's reference histograms, and the distance of any state from them.

    `contrast` adds eta times the likeness of the surrounding ring to the whole target to the
    squared distance: a box that shrinks into the target then pays for it, which the histogram alone
    does not see.
    """

    def __init__(
        self,
        image: Image,
        state: State,
        bins: Bins,
        layout: Layout,
        dense: Layout,
        *,
        around: Layout | None = None,
        contrast: float = 0.0,
    ) -> None:
        """Learn the reference.

        Args:
            image: First frame (H, W, 3).
            state: Where the target is in it.
            bins: What is counted.
            layout: Where states are read.
            dense: Where the reference is read: the same parts, more points.
            around: The ring, for the contrast.
            contrast: The weight eta.
        """
        self._bins, self._layout, self._ring = bins, layout, around
        self._contrast = contrast if around is not None else 0.0
        parts = histograms(image, bins, dense, state)
        self._root_parts = np.sqrt(parts)
        self._root_whole = np.sqrt(parts.mean(axis=0, keepdims=True))
        self._radius = max(layout.radius, around.radius if around is not None else 0.0)

    def distances(self, image: Image, states: Array) -> Array:
        """d_m (N,) of each state (N, 4)."""
        return _distance(self._coefficients(self._window(image, states), states))

    def energy(self, image: Image, states: Array) -> Array:
        """What a likelihood exp(-gamma energy) takes (N,): d_m^2 + eta * likeness of the ring."""
        window = self._window(image, states)
        squared = _distance(self._coefficients(window, states)) ** 2
        if self._ring is None or self._contrast == 0:
            return squared
        ring = (self._ring.points, self._ring.parts, self._ring.weights)
        likeness = hot.coefficients(window, states, *ring, self._root_whole)[:, 0]
        return squared + self._contrast * likeness

    def climb(
        self, image: Image, states: Array, *, most: int, tolerance: float, reach: float
    ) -> tuple[Array, Array, int]:
        """Mean shift from each state (N, 4): the states at the modes, their distances, the cost.

        Args:
            image: RGB (H, W, 3).
            states: Where to begin.
            most: Largest number of histograms read for a state.
            tolerance: A shorter shift ends a search [px].
            reach: How far a search may go [px].
        """
        window = self._window(image, states, reach)
        points, weights = self._layout.points, self._layout.weights
        found, rho, evaluations = hot.mean_shift(
            window, states, points, weights, self._root_parts, most, tolerance
        )
        return found, _distance(rho[:, None]), evaluations

    def _coefficients(self, window: hot.Window, states: Array) -> Array:
        at = (self._layout.points, self._layout.parts, self._layout.weights)
        return hot.coefficients(window, states, *at, self._root_parts)

    def _window(self, image: Image, states: Array, reach: float = 0.0) -> hot.Window:
        window = Window.around(states, self._radius, image, reach)
        return self._bins.label(image, window), window.left, window.top


def cell_model(
    image: Image,
    region: Region,
    state: State,
    bins: Bins,
    *,
    per_side: int,
    density: int,
    contrast: float,
    ring_width: float,
) -> SampledModel:
    """The template in per_side^2 cells, with a ring around it."""
    layout, dense = (grid(region, per_side, d) for d in (density, REFERENCE_DENSITY * density))
    around = ring(region, ring_width, max(per_side * density, LEAST_RING))
    return SampledModel(image, state, bins, layout, dense, around=around, contrast=contrast)


def disc_model(
    image: Image,
    region: Region,
    state: State,
    bins: Bins,
    *,
    density: int,
    contrast: float = 0.0,
    ring_width: float = 0.4,
) -> SampledModel:
    """The template under one Epanechnikov kernel, with a ring around it."""
    layout, dense = (disc(region, d) for d in (density, REFERENCE_DENSITY * density))
    around = ring(region, ring_width, max(density, LEAST_RING))
    return SampledModel(image, state, bins, layout, dense, around=around, contrast=contrast)


def _distance(rho: Array) -> Array:
    """d_m (N,) of coefficients (N, K)."""
    return np.sqrt(np.maximum(1.0 - rho.mean(axis=1), 0.0))
