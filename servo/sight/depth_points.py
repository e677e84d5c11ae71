"""Depth and plane of the target, computed from the pixels of a depth picture that are inside the
target.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from servo.types import Plane
from sim.types import Array, Camera, DepthPicture

FEWEST = 20
"""Smallest number of pixels with a depth that determine the target's plane; chosen by hand."""
TRIPLES = 64
"""Number of tested planes through three points: with 40 % outliers, all fail once in a million
times."""
SAMPLE = 500
"""Number of points at which planes are compared: enough for a median."""
OUTLIER = 4.5
"""Residual over the median residual from which a pixel is an outlier: 3 standard deviations."""
FAR_OUT = 10_000
"""Largest coordinate of a drawn corner [px]: OpenCV draws with small whole numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthPoints:
    """The n pixels of a depth picture that are inside the target: their normalised image
    coordinates (x, y, 1) (n, 3) and their inverse depths (n,) [1/m].

    Inverse depths of a plane are linear in the image coordinates. Their noise does not depend on
    the distance if the noise of the depths grows with its square.
    """

    rays: Array
    """Normalised image coordinates (x, y, 1) of the points (n, 3)."""
    near: Array
    """Inverse depths 1 / Z (n,) [1/m]."""

    @staticmethod
    def inside(corners: Array, depth: DepthPicture, camera: Camera) -> DepthPoints | None:
        """Return the pixels of a depth picture that are inside a quadrilateral and have a depth;
        None if they are fewer than 20.

        Args:
            corners: Corners of the quadrilateral, the target's (4, 2) [px], which must be convex.
            depth: Depth picture (H, W) [m], with nan or 0 for pixels without a depth.
            camera: Intrinsics of the depth picture.
        """
        mask = np.zeros(depth.shape, np.uint8)
        pixels = np.rint(corners - 0.5).clip(-FAR_OUT, FAR_OUT).astype(np.int32)
        cv2.fillConvexPoly(mask, pixels, 1)
        v, u = np.nonzero((mask > 0) & np.isfinite(depth) & (depth > 0))
        if len(u) < FEWEST:
            return None
        seen = camera.normalise(np.array([u, v], np.float64).T + 0.5)
        return DepthPoints(np.column_stack([seen, np.ones(len(u))]), 1 / depth[v, u].astype(float))

    @property
    def normal(self) -> Array:
        """Vector (A, B, C) [1/m] of the plane 1/Z = A x + B y + C in the camera frame that fits the
        points best, by least squares without outliers. Outliers are points far from the plane with
        the least median residual (Rousseeuw 1984, Least median of squares regression, Journal of
        the American Statistical Association 79).
        """
        draws = np.random.default_rng(0)  # the same points give the same plane
        drawn = draws.integers(0, len(self.near), (TRIPLES, 3))
        tried = np.linalg.pinv(self.rays[drawn]) @ self.near[drawn][..., None]
        sample = draws.integers(0, len(self.near), SAMPLE)
        residuals = np.abs((self.rays[sample] @ tried)[..., 0] - self.near[sample])
        best = tried[np.argmin(np.median(residuals, axis=1)), :, 0]
        off = np.abs(self.rays @ best - self.near)
        kept = off <= OUTLIER * np.median(off)
        return np.asarray(np.linalg.lstsq(self.rays[kept], self.near[kept])[0], np.float64)

    def plane(self, normal: Array) -> Plane:
        """Return the plane in the camera frame that has a given normal, and at the median of the
        points' image coordinates the median of their inverse depths.

        Args:
            normal: Vector (3,) along the plane's normal in the camera frame, of any length.
        """
        middle = np.median(self.rays, axis=0)
        return Plane(*(normal * np.median(self.near) / (normal @ middle)).tolist())
