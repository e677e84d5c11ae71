"""The multiple-kernel representation with constant kernels, as the particle filter uses it
(Teuliere, Marchand, Eck, sections II and IV-B).

The paper's equations (1) to (5), as we read them:

    f_x(l)  = R(-theta) (l - (x, y)) / s                       the image in template coordinates
    q_u(x)  = C sum_i K(f_x(l_i) - c) delta[b(l_i) - u]        histogram, sums to 1
    rho(x)  = sum_u sqrt(q*_u q_u(x))                          Bhattacharyya coefficient
    d_m(x)  = sqrt(1 - mean_j rho_j(x))                        over the parts j

The distance is the mean over the nine parts, not the sum: the sum is the same likelihood with nine
times gamma, under which 300 particles leave an effective sample of two.

The template is read at fixed points that every state carries along, not at whole pixels, so that C
is a constant, a state costs the same at every scale, and no point lies outside the object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking import hot
from tracking.appearance.colour import ColourBins, Window
from tracking.types import Region, State

REFERENCE_DENSITY = 4
"""The reference is read this much more densely a side, so that it does not depend on the pixel
grid.
"""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where a template is read, and which part each point belongs to."""

    points: Array
    """Template points (P, 2) [px]."""
    parts: NDArray[np.int64]
    """Part of each point (P,)."""

    @property
    def radius(self) -> float:
        """Distance of the farthest point from the centre [px]."""
        return float(np.max(np.hypot(self.points[:, 0], self.points[:, 1])))


def grid(region: Region, per_side: int, density: int) -> Layout:
    """The template cut into per_side^2 equal parts, with density^2 points in each."""
    steps = per_side * density
    at = (np.arange(steps) + 0.5) / steps - 0.5
    u, v = np.meshgrid(at, at)
    column, row = np.meshgrid(np.arange(steps) // density, np.arange(steps) // density)
    points = np.stack([u.ravel() * region.width, v.ravel() * region.height], axis=1)
    return Layout(points, (row * per_side + column).ravel())


def ring(region: Region, width: float, density: int) -> Layout:
    """One part: the frame around the template, out to (1 + width) times its size."""
    outer = 1.0 + width
    at = outer * ((np.arange(density) + 0.5) / density - 0.5)
    u, v = np.meshgrid(at, at)
    outside = np.maximum(np.abs(u), np.abs(v)) > 0.5
    points = np.stack([u[outside] * region.width, v[outside] * region.height], axis=1)
    return Layout(points, np.zeros(len(points), np.int64))


def histograms(image: Image, bins: ColourBins, layout: Layout, state: State) -> Array:
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
    np.add.at(counts, (layout.parts[inside], labels[row[inside], column[inside]]), 1.0)
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)


class CellModel:
    """The target's reference histograms, and the distance of any state from them.

    `contrast` adds eta times the likeness of the surrounding ring to the whole target to the
    squared distance: a box that shrinks into the target then pays for it, which the histogram alone
    does not see.
    """

    def __init__(
        self,
        image: Image,
        region: Region,
        state: State,
        bins: ColourBins,
        *,
        per_side: int,
        density: int,
        contrast: float,
        ring_width: float,
    ) -> None:
        self._bins, self._contrast = bins, contrast
        self._layout = grid(region, per_side, density)
        self._ring = ring(region, ring_width, per_side * density)
        dense = grid(region, per_side, REFERENCE_DENSITY * density)
        parts = histograms(image, bins, dense, state)
        self._root_parts = np.sqrt(parts)
        self._root_whole = np.sqrt(parts.mean(axis=0, keepdims=True))
        self._radius = max(self._layout.radius, self._ring.radius)
        self.evaluations = 0

    def distances(self, image: Image, states: Array) -> tuple[Array, Array]:
        """d_m (N,) of each state (N, 4), and the likeness of its ring to the target (N,)."""
        window = Window.around(states, self._radius, image)
        labels = self._bins.label(image, window)
        self.evaluations += len(states)

        def coefficient(layout: Layout, root_reference: Array) -> Array:
            at = (labels, window.left, window.top, states)
            return hot.bhattacharyya_of_cells(*at, layout.points, layout.parts, root_reference)

        rho = coefficient(self._layout, self._root_parts).mean(axis=1)
        if self._contrast == 0:
            return np.sqrt(np.maximum(1.0 - rho, 0.0)), np.zeros(len(states))
        likeness = coefficient(self._ring, self._root_whole)[:, 0]
        return np.sqrt(np.maximum(1.0 - rho, 0.0)), likeness

    def energy(self, image: Image, states: Array) -> Array:
        """What a likelihood exp(-gamma energy) takes (N,): d_m^2 + eta * likeness of the ring."""
        distance, likeness = self.distances(image, states)
        return distance**2 + self._contrast * likeness
