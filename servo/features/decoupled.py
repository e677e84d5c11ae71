"""Feature set of corners and pose: the camera moves straight to its goal, and its rotation reduces
the remaining error of the corners (Deguchi 1998).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._points_and_pose import POINTS, TRANSLATION, PointsAndPose
from sim.types import Array, Camera


@dataclass(frozen=True, slots=True)
class Config:
    """The feature set `decoupled` has no settings."""

    def build(self, outline: Array) -> "DecoupledFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return DecoupledFeatures()


@final
class DecoupledFeatures(PointsAndPose):
    """Feature set s = (x0, y0, ..., x3, y3, t, theta u) (14,): the target's corners in normalised
    image coordinates, and translation [m] and rotation vector [rad] of c*Mc, the pose of the camera
    in the frame of the desired camera. The pose controls the camera's translation, and the
    remaining error of the corners its rotation.

    Deguchi 1998 (Optimal motion control for image-based visual servoing by decoupling translation
    and rotation, IROS), as Gans, Hutchinson and Corke 2003 describe it: v = -lambda t in the
    camera's frame, and w = Lw+ (-lambda e - Lv v) over the corners, with Lv and Lw the columns of
    their interaction matrix for v and w. Written from their description, without Deguchi's text.
    """

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the matrix (6, 14) that replaces the pseudo-inverse L# in the law v = -lambda L#
        e, with the feature error e (14,) and the camera twist v (6,) in the camera frame [m/s,
        rad/s].

        Args:
            L: Interaction matrix (14, 6) of the features.
            values: Features (14,); not used.
            camera: Intrinsics; not used.
        """
        inverse = np.zeros(L.T.shape)
        inverse[:3, TRANSLATION] = L[TRANSLATION, :3].T
        left = np.eye(POINTS.stop, len(L)) - L[POINTS, :3] @ inverse[:3]
        inverse[3:] = np.linalg.pinv(L[POINTS, 3:]) @ left
        return inverse
