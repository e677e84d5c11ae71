"""Feature set of pose and corners: the pose, and the corners that are near the picture's border
(Kermorgant, Chaumette 2014).
"""

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
    """Settings of the feature set `weighted` (pose and corners): the width of the band along the
    picture's sides in which a corner counts, the more the nearer it is to the side, as a share of
    half the picture's width or height.
    """

    border: Annotated[float, Gt(0), Lt(1)] = 0.3
    """Width of the border in which corners count, over half the width (or height) of the
    picture."""

    def build(self, outline: Array) -> "WeightedFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return WeightedFeatures(self.border)


@final
class WeightedFeatures(PointsAndPose):
    """Feature set s = (x0, y0, ..., x3, y3, t, theta u) (14,): the target's corners in normalised
    image coordinates, and translation [m] and rotation vector [rad] of c*Mc, the pose of the camera
    in the frame of the desired camera. Each feature has a weight: 1 for the pose; for a coordinate
    of a corner 0 in the inner part of the picture, and larger the nearer it is to a side of the
    picture.

    Kermorgant and Chaumette 2011 (Combining IBVS and PBVS to ensure the visibility constraint,
    IROS) and 2014 (Dealing with constraints in sensor-based robot control, IEEE Transactions on
    Robotics 30): v = -lambda (H L)+ H e, with the weights h = (s - safe) / (limit - s) on the
    diagonal of H; `safe` is where the border begins, `limit` the side of the picture.
    """

    def __init__(self, border: float) -> None:
        """Store the width of the border, over half the width (or height) of the picture."""
        super().__init__()
        self._border = border

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the matrix (6, 14) that replaces the pseudo-inverse L# in the law v = -lambda L#
        e, with the feature error e (14,) and the camera twist v (6,) in the camera frame [m/s,
        rad/s]: a pseudo-inverse of L with the weights of the corners at their present places in the
        picture.

        Args:
            L: Interaction matrix (14, 6) of the features.
            values: Features (14,); the first eight are the corners' normalised image coordinates.
            camera: Intrinsics, and size of the picture.
        """
        h = np.ones(len(L))
        h[POINTS] = self._weights(values[POINTS].reshape(-1, 2), camera).ravel()
        return np.linalg.pinv(h[:, None] * L) * h

    def _weights(self, corners: Array, camera: Camera) -> Array:
        """Return the weights (4, 2) of the coordinates of four corners (4, 2) in normalised image
        coordinates: 0 in the inner part of the picture, up to 1000 at its sides and outside.
        """
        pixels = camera.to_pixels(corners)
        half = np.array([camera.width, camera.height]) / 2
        out = np.abs(pixels - half) / half  # 0 in the middle, 1 at the border
        beyond = np.maximum(out - (1 - self._border), 0.0)
        return np.minimum(beyond / np.maximum(1 - out, self._border / LARGEST), LARGEST)
