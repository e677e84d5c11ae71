"""The pose, and near the picture's border the corners too (Kermorgant, Chaumette 2014)."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Gt, Lt

from servo.features._points_and_pose import POINTS, PointsAndPose
from sim.types import Array, Camera

LARGEST = 1e3
"""Weight of a corner at the border or outside: far above 1, yet small enough that rounding errors
do not swamp the pose."""


@dataclass(frozen=True, slots=True)
class Config:
    """Where the corners begin to count."""

    border: Annotated[float, Gt(0), Lt(1)] = 0.3
    """Width of the border in which corners count, over half the width (or height) of the
    picture."""

    def build(self, outline: Array) -> "WeightedFeatures":
        """Return the feature set, which is the same for any outline (4, 3)."""
        return WeightedFeatures(self.border)


@final
class WeightedFeatures(PointsAndPose):
    """Corners and pose, weighted: the pose by 1; a corner's coordinate by h = 0 in the inner part
    of the picture, and more towards the border.

    Kermorgant and Chaumette 2011 (Combining IBVS and PBVS to ensure the visibility constraint,
    IROS) and 2014 (Dealing with constraints in sensor-based robot control, IEEE Transactions on
    Robotics 30): v = -lambda (H L)+ H e, with h = (s - safe) / (limit - s) beyond the safe part.
    """

    def __init__(self, border: float) -> None:
        """Set the width of the border, over half the picture's."""
        super().__init__()
        self._border = border

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the matrix (6, 14) that maps the error to the twist."""
        h = np.ones(len(L))
        h[POINTS] = self._weights(values[POINTS].reshape(-1, 2), camera).ravel()
        return np.linalg.pinv(h[:, None] * L) * h

    def _weights(self, corners: Array, camera: Camera) -> Array:
        """Return the weights (4, 2) of corners (4, 2) in normalised image coordinates."""
        pixels = camera.to_pixels(corners)
        half = np.array([camera.width, camera.height]) / 2
        out = np.abs(pixels - half) / half  # 0 in the middle, 1 at the border
        beyond = np.maximum(out - (1 - self._border), 0.0)
        return np.minimum(beyond / np.maximum(1 - out, self._border / LARGEST), LARGEST)
