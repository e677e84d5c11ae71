"""Feature set of 2 1/2 D servoing: image point and depth of the target's centre, and rotation
(Malis, Chaumette, Boudet 1999).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import final

import numpy as np

from servo.features._rotation import SOLE_DOF, WithRotation, rotation_rows, theta_u
from servo.sight.point_rows import point_rows
from servo.types import Sight
from sim.types import Array

NOISE = (2e-4, 2e-4, 2e-3, 5e-3, 5e-3, 1e-3)
"""Standard deviations from frame to frame, of a target of 0.1 m at 1 m with f = 600 px."""


@dataclass(frozen=True, slots=True)
class Config:
    """The feature set `hybrid` has no settings."""

    def build(self, outline: Array) -> "HybridFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return HybridFeatures()


@final
class HybridFeatures(WithRotation):
    """Feature set s = (x, y, log(Z / Z*), theta u) (6,): normalised image coordinates x, y and
    depth Z of the target's centre, with Z* the depth at the goal, and the rotation vector theta u
    [rad] of c*Rc, the rotation of the camera in the frame of the desired camera.

    Malis, Chaumette and Boudet 1999 (2 1/2 D visual servoing, IEEE Transactions on Robotics and
    Automation 15). The centre moves on a straight line in the image, and stays in view.
    """

    names = ("x", "y", "logZ", "rx", "ry", "rz")
    units = ("1", "1", "1", "rad", "rad", "rad")
    feed_forward = ("x", "y")
    sole_dof: Mapping[str, str] = {**SOLE_DOF, "logZ": "vz"}
    noise = np.array(NOISE)

    def values(self, sight: Sight) -> Array:
        """Return the features (6,) from the target's poses in the camera frame now and at the goal:
        x and y of the target's centre in normalised image coordinates, the logarithm of its depth
        over that at the goal, and the rotation vector theta u (3 numbers) [rad] of the camera in
        the frame of the desired camera.
        """
        X, Y, Z = sight.pose.translation.tolist()
        goal = sight.aim.pose
        turn = theta_u(goal.rotation @ sight.pose.rotation.T)
        return np.array([X / Z, Y / Z, log(Z / goal.translation[2]), *turn])

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (6, 6) of the features at the present pose: ds/dt = L v
        for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        X, Y, Z = sight.pose.translation
        x = X / Z
        y = Y / Z
        turn = theta_u(sight.aim.pose.rotation @ sight.pose.rotation.T)
        L = np.zeros((6, 6))
        L[0:1], L[1:2] = point_rows(*np.array([[x], [y], [1 / Z]]))
        L[2] = 0.0, 0.0, -1 / Z, -y, x, 0.0
        L[3:, 3:] = rotation_rows(turn)
        return L
