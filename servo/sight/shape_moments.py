"""Exact image moments of polygons, of rotated rectangles, and of the rectangle that a tracker
reports.
"""

from math import cos, sin

import numpy as np

from servo.types import Moments
from sim.types import Array, Camera
from tracking.types import Region, State

BARYCENTRIC = np.array([[1, 1, 1], [1.8, 0.6, 0.6], [0.6, 1.8, 0.6], [0.6, 0.6, 1.8]]) / 3
WEIGHTS = np.array([-27.0, 25.0, 25.0, 25.0]) / 48
"""A quadrature that is exact for cubic polynomials over a triangle."""


def of_polygon(polygon: Array) -> Moments:
    """Return area, centroid and central moments up to third order of a filled polygon, in
    normalised image coordinates.

    Args:
        polygon: Corners (n, 2) in normalised image coordinates, clockwise or counterclockwise; the
            sides must not cross.
    """
    # Relative to the centroid, so that central moments do not lose digits.
    middle = polygon.mean(axis=0)
    corners = polygon - middle
    areas, after = _triangles(corners)
    area = float(areas.sum())
    offset = areas @ (corners + after) / (3 * area)
    centre = middle + offset
    corners = corners - offset
    areas, after = _triangles(corners)
    nodes = BARYCENTRIC[:, 1, None, None] * corners + BARYCENTRIC[:, 2, None, None] * after
    x = nodes[..., 0].ravel()
    y = nodes[..., 1].ravel()
    xx = x * x
    yy = y * y
    powers = np.array([xx, x * y, yy, xx * x, xx * y, x * yy, yy * y])
    mu = powers @ np.outer(WEIGHTS, areas).ravel() * np.sign(area)
    return Moments(abs(area), *centre.tolist(), *mu.tolist())


def of_rectangle(
    x: float, y: float, width: float, height: float, theta: float, stretch: tuple[float, float]
) -> Moments:
    """Return area, centroid and central moments of a rotated rectangle that is then stretched along
    the image's axes, such as one in pixels that is converted to normalised image coordinates.

    Args:
        x: Centre after stretching, to the right, in normalised image coordinates.
        y: Centre after stretching, down, in normalised image coordinates.
        width: Length of the rectangle along its own x axis, before stretching.
        height: Length of the rectangle along its own y axis, before stretching.
        theta: Rotation from +x (right) towards +y (down), before stretching [rad].
        stretch: Factors along the image's x and y axes, such as 1 / fx and 1 / fy for a rectangle
            in pixels.
    """
    c = cos(theta)
    s = sin(theta)
    long = width**2 / 12
    short = height**2 / 12
    (fx, fy) = stretch
    area = width * height * fx * fy
    return Moments(
        area=area,
        xg=x,
        yg=y,
        mu20=area * fx * fx * (long * c * c + short * s * s),
        mu11=area * fx * fy * (long - short) * s * c,
        mu02=area * fy * fy * (long * s * s + short * c * c),
        mu30=0.0,
        mu21=0.0,
        mu12=0.0,
        mu03=0.0,
    )


def of_corners(corners: Array, camera: Camera) -> Moments:
    """Return area, centroid and central moments, in normalised image coordinates, of a filled
    polygon.

    Args:
        corners: Corners (n, 2) [px].
        camera: Intrinsics, with the lens distortion that is removed.
    """
    return of_polygon(camera.normalise(corners))


def of_state(state: State, region: Region, camera: Camera) -> Moments:
    """Return area, centroid and central moments, in normalised image coordinates, of the rectangle
    that a tracker reports; for a lens that distorts, those of the quadrangle of its undistorted
    corners.

    Args:
        state: Position [px], angle [rad] and scale of the rectangle.
        region: Width and height of the rectangle at scale 1 [px].
        camera: Intrinsics and lens distortion.
    """
    if camera.distortion is not None:
        return of_corners(region.corners(state), camera)
    x = (state.x - camera.cx) / camera.fx
    y = (state.y - camera.cy) / camera.fy
    width = state.scale * region.width
    height = state.scale * region.height
    return of_rectangle(x, y, width, height, state.theta, (1 / camera.fx, 1 / camera.fy))


def _triangles(corners: Array) -> tuple[Array, Array]:
    """Return the signed areas (n,) of the triangles between the origin and each edge of a polygon
    (n, 2), and the second ends of the edges (n, 2).
    """
    after = np.concatenate([corners[1:], corners[:1]])
    return (corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]) / 2, after
