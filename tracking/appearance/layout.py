"""Where a template is read: points in parts under kernels, and the histograms they give.

A template is read at points that every state carries along, not at whole pixels, so that a
histogram's normaliser is a constant, a state costs the same at every scale, and no point lies
outside the object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.types import Array
from tracking.appearance.bins import Labelled
from tracking.hot import point_histograms as hot
from tracking.types import Region, State

TINY = 1e-12
LEAST_RING = 8
"""Points along each side of a ring: with fewer, none might lie outside the template."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where a template is read, which part each point belongs to, and what it weighs."""

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

    @staticmethod
    def of(points: Array, parts: NDArray[np.int64], kernel: Array) -> Layout:
        """A layout with the kernel's values (P,) normalised over each part."""
        mass = np.bincount(parts, kernel)
        radius = float(np.max(np.hypot(points[:, 0], points[:, 1])))
        return Layout(points, parts, kernel / mass[parts], radius, len(mass))


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
    density = max(density, LEAST_RING)
    outer = 1.0 + width
    at = outer * ((np.arange(density) + 0.5) / density - 0.5)
    u, v = np.meshgrid(at, at)
    outside = np.maximum(np.abs(u), np.abs(v)) > 0.5
    points = np.stack([u[outside] * region.width, v[outside] * region.height], axis=1)
    return Layout.of(points, np.zeros(len(points), np.int64), np.ones(len(points)))


def histograms(image: Labelled, layout: Layout, state: State) -> Array:
    """Normalised histograms (K, B) of the parts of a layout; points off the image are left out."""
    vector = state.vector
    window = image.around(vector[None], layout.radius)
    at = (layout.points, layout.parts, layout.weights)
    counts = hot.histograms(window, vector, *at, layout.count, image.bins.count)
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), TINY)
