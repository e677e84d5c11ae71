"""The target in a depth picture: how far it is, and how its plane lies."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from servo.types import Plane
from sim.types import Array, Camera, DepthPicture

FEWEST = 20
"""Fewer pixels with a depth say nothing of the target; chosen by hand."""
TRIPLES = 64
"""Planes through three points that are tried: with 40 % elsewhere, 1 in a million times all miss.
"""
SAMPLE = 500
"""Points at which they are compared: enough for a median."""
OUTLIER = 4.5
"""Residuals over their median from which a pixel is not of the plane: 3 standard deviations."""
FAR_OUT = 10_000
"""Corners farther out are drawn there, because pixels are small whole numbers [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthPoints:
    """Points of the target.

    They have inverse depths, which change evenly over the picture of a plane, and whose noise is
    the same at each distance where that of a depth grows with its square.
    """

    rays: Array
    """Where they are seen (n, 3): normalised coordinates x, y, 1."""
    near: Array
    """Inverse depths 1 / Z (n,) [1/m]."""

    @staticmethod
    def inside(corners: Array, depth: DepthPicture, camera: Camera) -> DepthPoints | None:
        """Return those that a depth picture has in a quadrilateral; None where these are too few.

        Args:
            corners: Of the target (4, 2) [px].
            depth: The picture (H, W) [m], nan or 0 where there is no depth.
            camera: That of the picture.
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
        """Normal (3,) of the plane 1/Z = A x + B y + C that fits them by least squares, without
        those that lie elsewhere: off the plane whose median residual is the least (Rousseeuw 1984,
        Least median of squares regression, Journal of the American Statistical Association 79).
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
        """Return the plane with a normal (3,) at their median depth, which is that of their middle
        if they lie in a plane.
        """
        middle = np.median(self.rays, axis=0)
        return Plane(*(normal * np.median(self.near) / (normal @ middle)).tolist())
