"""Feature set of translation and rotation: position-based servoing (Chaumette, Hutchinson 2006)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from servo.features._rotation import SOLE_DOF, WithRotation, rotation_rows, theta_u
from servo.types import Sight
from sim.geometry import skew
from sim.types import Array

Error = Literal["cdMc", "cMo"]
NOISE = (2e-4, 2e-4, 2e-3, 5e-3, 5e-3, 1e-3)
"""Standard deviations from frame to frame, of a target of 0.1 m at 1 m with f = 600 px: [m] and
[rad]; depth and tilts are seen worst."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the feature set `pose`: which translation is servoed, that of the camera in the
    frame of the desired camera ("cdMc"), or that of the target in the camera frame ("cMo").
    """

    error: Error = "cdMc"
    """Translation that is servoed: "cdMc", that of the camera in the frame of the desired camera,
    so that the camera moves straight; "cMo", that of the target in the camera frame, so that the
    target's centre moves straight in the image."""

    def build(self, outline: Array) -> "PoseFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return PoseFeatures(self.error)


@final
class PoseFeatures(WithRotation):
    """Feature set s = (t, theta u) (6,) of position-based servoing. The translation t [m] is, as
    set, that of c*Mc ("cdMc", the pose of the camera in the frame of the desired camera) or of cMo
    ("cMo", the pose of the target in the camera frame). The rotation vector theta u [rad] is always
    that of c*Mc.

    Chaumette and Hutchinson 2006 (Visual servo control, part I: basic approaches, IEEE Robotics and
    Automation Magazine 13), equations 16 to 19. With "cdMc" the corners may leave the picture.
    """

    names = ("x", "y", "z", "rx", "ry", "rz")
    units = (*(("m",) * 3), *(("rad",) * 3))
    feed_forward = ("x", "y", "z")
    sole_dof: Mapping[str, str] = SOLE_DOF
    noise = np.array(NOISE)

    def __init__(self, error: Error) -> None:
        self._camera_moves = error == "cdMc"

    def values(self, sight: Sight) -> Array:
        """Return the features (6,) from the target's poses in the camera frame now and at the goal:
        the translation [m] of the camera in the frame of the desired camera (setting "cdMc") or of
        the target in the camera frame ("cMo"), and the rotation vector [rad] of the camera in the
        frame of the desired camera.
        """
        moved = sight.aim.pose @ sight.pose.inverse()
        t = moved.translation if self._camera_moves else sight.pose.translation
        return np.concatenate([t, theta_u(moved.rotation)])

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return a flag (6,) for each of x, y, z, rx, ry and rz, True if it is measured. Without
        the target's angle none is; with it x, y and rz are, z if its size is measured too, and rx
        and ry if the tilt of its plane is.
        """
        return super().known(sight) & sight.angle_known

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (6, 6) of the features at the present pose: ds/dt = L v
        for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        R = sight.aim.pose.rotation @ sight.pose.rotation.T
        L = np.zeros((6, 6))
        L[3:, 3:] = rotation_rows(theta_u(R))
        if self._camera_moves:
            L[:3, :3] = R
        else:
            L[:3, :3] = -np.eye(3)
            L[:3, 3:] = skew(sight.pose.translation)
        return L
