"""The plane in which the target drives, fitted to where it has been seen."""

from __future__ import annotations

from typing import final

import numpy as np

from sim.types import Array, Pose

TILT_SD = np.radians(10.0)
"""How far the plane may be tilted from the image's at the start [rad]."""
DEPTH_SD = 0.02
"""Standard deviation of a seen point, across the plane [m]."""


@final
class PlaneFit:
    """Least squares with a prior: at the start the camera faces the plane.

    Of all unit normals m it takes the one that minimises

        sum (m (P - mean P))^2 / DEPTH_SD^2  -  (m m0)^2 / TILT_SD^2

    an eigenvector. A target that has driven on one line only gives no information on the tilt
    about it; there the prior stays.
    """

    def __init__(self) -> None:
        self._count = 0
        self._mean = np.zeros(3)
        self._scatter = np.zeros((3, 3))
        self._prior: Array | None = None

    def normal(self, T_base_camera: Pose) -> Array:
        """Return the normal (3,) in the camera frame, away from the camera."""
        if self._prior is None:
            self._prior = T_base_camera.rotation[:, 2].copy()
        prior = np.outer(self._prior, self._prior) / TILT_SD**2
        m = np.linalg.eigh(self._scatter / DEPTH_SD**2 - prior)[1][:, 0]
        seen = T_base_camera.rotation.T @ m
        return seen if seen[2] > 0 else -seen

    def add(self, T_base_camera: Pose, point: Array) -> None:
        """Take a point (3,) of the camera frame at which the target was [m]."""
        P = T_base_camera.apply(point)
        self._count += 1
        before = P - self._mean
        self._mean = self._mean + before / self._count
        self._scatter += np.outer(before, P - self._mean)
