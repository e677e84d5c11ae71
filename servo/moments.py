"""Exact moments of polygons."""

from __future__ import annotations

import numpy as np

from servo.types import Moments
from sim.types import Array

BARYCENTRIC = np.array([[1, 1, 1], [1.8, 0.6, 0.6], [0.6, 1.8, 0.6], [0.6, 0.6, 1.8]]) / 3
WEIGHTS = np.array([-27.0, 25.0, 25.0, 25.0]) / 48
"""A quadrature that is exact for cubic polynomials over a triangle."""


def of_polygon(polygon: Array) -> Moments:
    """Moments up to third order of a simple polygon (n, 2) in normalised coordinates, whatever its
    sense.
    """
    area, centre = _area_and_centre(polygon)
    corners = polygon - centre
    nodes, weights = _nodes(corners)
    x, y = nodes.T

    def mu(p: int, q: int) -> float:
        return float(np.sign(area) * np.sum(weights * x**p * y**q))

    return Moments(
        area=abs(area), xg=float(centre[0]), yg=float(centre[1]),
        mu20=mu(2, 0), mu11=mu(1, 1), mu02=mu(0, 2),
        mu30=mu(3, 0), mu21=mu(2, 1), mu12=mu(1, 2), mu03=mu(0, 3),
    )  # fmt: skip


def _area_and_centre(polygon: Array) -> tuple[float, Array]:
    origin = polygon.mean(axis=0)
    nodes, weights = _nodes(polygon - origin)
    area = float(weights.sum())
    return area, origin + weights @ nodes / area


def _nodes(corners: Array) -> tuple[Array, Array]:
    """Quadrature nodes (m, 2) and weights (m,) of the triangles from the origin to each edge."""
    after = corners[np.arange(1, len(corners) + 1) % len(corners)]
    areas = (corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]) / 2
    nodes = BARYCENTRIC[:, 1, None, None] * corners + BARYCENTRIC[:, 2, None, None] * after
    return nodes.reshape(-1, 2), np.outer(WEIGHTS, areas).ravel()
