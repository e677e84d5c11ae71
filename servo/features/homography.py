"""Feature set of the camera's pose relative to the goal, from a homography between the camera's
picture and the goal's, without a tracker (Benhimane, Malis 2007).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.features._pictures import picture_of
from servo.features._rotation import SOLE_DOF, WithRotation, rotation_rows, theta_u
from servo.sight.picture_match import Method, alignment
from servo.sight.plane_motion import PlaneMotion
from servo.types import CameraImage, Sight
from sim.channels import Channel
from sim.types import Array, Pose

NOISE = (1e-3, 1e-3, 2e-3, 2e-3, 2e-3, 1e-3)
"""Standard deviations from picture to picture of 320 x 240 px at 0.6 m, with SIFT: [m], [rad]."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the feature set `homography`: the method that aligns the camera's picture with
    the goal's.
    """

    method: Method = "sift"
    """Matched points, "orb", "sift" or "affine_sift" (with contrast equalised, and matched also to
    the goal as it looks from the side); or all pixels, "ecc", from a start near the goal."""
    needs = frozenset({Channel.PICTURE, Channel.GOAL_PICTURE})

    def build(self, outline: Array) -> "HomographyFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return HomographyFeatures(self.method)


@final
class HomographyFeatures(WithRotation):
    """Feature set s = (t, theta u) (6,): translation t [m] and rotation vector theta u [rad] of
    c*Mc, the pose of the camera in the frame of the desired camera, computed from the homography
    between the camera's picture and the one taken at the goal.

    Benhimane and Malis 2007 (Homography-based 2D visual tracking and servoing, International
    Journal of Robotics Research 26) servo the homography itself; here it is decomposed. Of the
    scene only the depth at the goal is used, on the optical axis. What is seen should be flat.
    """

    names = ("x", "y", "z", "rx", "ry", "rz")
    units = (*(("m",) * 3), *(("rad",) * 3))
    feed_forward = ()
    sole_dof: Mapping[str, str] = SOLE_DOF
    noise = np.array(NOISE)

    def __init__(self, method: Method) -> None:
        self._method: Method = method
        self._wanted: CameraImage | None = None
        self._picture: CameraImage | None = None
        self._moved: Pose | None = None

    def values(self, sight: Sight) -> Array:
        """Return the features (6,) for the current picture: translation [m] and rotation vector
        [rad] of the camera in the frame of the desired camera. They are zero if the pictures cannot
        be aligned; `known` is then False.

        Args:
            sight: The current picture, and in its `goal` the picture at the goal; of the target
                only the depth at the goal is used.

        Raises:
            ValueError: One of the pictures is missing.
        """
        moved = self._motion(sight)
        if moved is None:
            return np.zeros(6)
        return np.concatenate([moved.translation, theta_u(moved.rotation)])

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return six flags (6,), all True if the current picture can be aligned with the one at the
        goal, else all False; all True too if `sight` has no picture, as in planning.

        Raises:
            ValueError: There is a current picture, and the one at the goal is missing.
        """
        return np.full(6, sight.picture is None or self._motion(sight) is not None)

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (6, 6) of the features: ds/dt = L v for a camera twist v
        (6,) in the camera frame [m/s, rad/s] and a scene at rest. If the pictures cannot be aligned
        it is that at the goal, the identity.

        Raises:
            ValueError: The current picture or the one at the goal is missing.
        """
        moved = self._motion(sight)
        R = np.eye(3) if moved is None else moved.rotation
        L = np.zeros((6, 6))
        L[:3, :3] = R
        L[3:, 3:] = rotation_rows(theta_u(R))
        return L

    def _motion(self, sight: Sight) -> Pose | None:
        """Return c*Mc, the camera's pose in the desired camera's frame; None if the pictures could
        not be aligned. The result for the last picture is kept.

        Raises:
            ValueError: One of the pictures is missing.
        """
        goal = sight.aim
        picture, wanted = picture_of(sight), picture_of(goal)
        if wanted is not self._wanted:
            self._wanted = wanted
            self._alignment = alignment(self._method, wanted)
            self._plane_motion = PlaneMotion()
        if picture is not self._picture:
            self._picture = picture
            self._moved = self._measured(goal, picture)
        return self._moved

    def _measured(self, goal: Sight, picture: CameraImage) -> Pose | None:
        if picture is goal.picture:
            return Pose(np.eye(3), np.zeros(3))
        H = self._alignment.find(picture.image)
        if H is None:
            return None
        found = self._plane_motion.of(H)
        if found is None:
            return None
        R, t, n = found
        distance = n[2] / goal.plane.C
        return Pose(R, distance * t).inverse()
