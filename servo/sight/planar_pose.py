"""Pose of a flat rectangle from its four corners in each of successive pictures; earlier pictures
decide between the two poses that fit the corners.

A small or distant plane looks nearly the same if it is tilted to the other side of the line of
sight (Schweighofer, Pinz 2006, "Robust Pose Estimation from a Planar Target", IEEE Transactions on
Pattern Analysis and Machine Intelligence 28(12)). Both poses come from Collins, Bartoli 2014,
"Infinitesimal Plane-based Pose Estimation" (IPPE), International Journal of Computer Vision 109(3);
where the corners do not decide between them, the poses in earlier pictures do.
"""

from typing import final

import cv2
import numpy as np
from cv2.typing import MatLike

from sim.types import Array, Pose

NOISE = 0.008
"""Standard deviation of a corner, over the square root of the seen area."""
TURN = np.radians(5.0)
"""Standard deviation of the rotation between a pose and the expected one [rad]."""
TILT = np.radians(30.0)
"""Standard deviation of the tilt of a rectangle without an expected pose [rad]."""
FLATTEST = 1e-4
"""Smallest area of the triangle at a corner, over the sum of the four: below, it is no corner."""
UNIT = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]) / 2
"""Corners (4, 3) of a unit square, in the order of `Region.corners`."""


@final
class CornersToPose:
    """Computes the pose of a rectangle from its four corners in each of successive pictures. `size`
    is the rectangle's length along x and its width along y [m].

    In each picture two poses fit the corners. Each of them continues the path through the earlier
    poses that costs less (Viterbi's algorithm), so a pose that was chosen wrongly at first is
    corrected later.
    """

    def __init__(self, size: tuple[float, float]) -> None:
        """Create it for a rectangle of a size (length along x, width along y) [m]."""
        self._size = size
        self._paths: list[tuple[Pose, float]] = []

    def of(self, corners: Array, T_base_camera: Pose) -> Pose | None:
        """Return the pose T_camera_object [m] of the rectangle in the camera frame; None if no
        rectangle that is seen from above has these corners. Call it for each picture, in order: the
        earlier poses help to decide between the two that fit the corners. For that the target
        should move little between pictures; the camera may move.

        The object's origin is in the centre of the rectangle; x goes along the target's nose, y to
        the right of the nose as seen from above, z into the table. The rotation is the identity if
        the camera faces the target and its nose points to the right.

        Args:
            corners: Corners (4, 2) in normalised image coordinates, in the order rear left, front
                left, front right, rear right, where the nose is in front and the target is seen
                from above.
            T_base_camera: Pose of the camera in the robot's base frame when the picture was taken.
        """
        found = _candidates(corners, self._size)
        if not found:
            return None
        T_camera_base = T_base_camera.inverse()
        # Viterbi: each candidate continues the cheaper of the two paths so far.
        before = [(T_camera_base @ pose, cost) for pose, cost in self._paths] or [(None, 0.0)]
        costs = [
            error + min(cost + _prior_cost(pose, expected) for expected, cost in before)
            for pose, error in found
        ]
        least = min(costs)  # subtracted, so that costs do not grow without limit
        self._paths = [
            (T_base_camera @ pose, cost - least)
            for (pose, _), cost in zip(found, costs, strict=True)
        ]
        return refined(found[costs.index(least)][0], corners, self._size)


def _candidates(corners: Array, size: tuple[float, float]) -> list[tuple[Pose, float]]:
    """Return the poses T_camera_object [m] of a rectangle that fit its corners best, at most two,
    each with its cost: the squared error over the variance of the corners' noise. The list is empty
    if no rectangle that is seen from above has these corners.

    Args:
        corners: Corners (4, 2) in normalised image coordinates.
        size: Length and width of the rectangle [m].
    """
    along = np.roll(corners, -1, axis=0) - corners
    before = np.roll(along, 1, axis=0)
    turns = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
    if not turns.min() > FLATTEST * turns.sum() > 0:  # nan is not
        return []
    model = UNIT * (*size, 0.0)
    found: list[tuple[Pose, float]] = []
    # At half a turn IPPE divides by nearly zero: it then gets the rectangle turned by half a turn.
    back = corners[1:3, 0].sum() < corners[[0, 3], 0].sum()
    for vector, t in _solutions(model, np.roll(corners, 2, axis=0) if back else corners):
        R = cv2.Rodrigues(vector)[0] * ((-1, -1, 1) if back else 1)
        pose = Pose(R.astype(np.float64), t.ravel().astype(np.float64))
        seen = pose.apply(model)
        if np.isfinite(seen).all() and seen[:, 2].min() > 0:
            miss = seen[:, :2] / seen[:, 2:] - corners
            found.append((pose, float(np.vdot(miss, miss)) / (NOISE**2 * turns.sum() / 4)))
    return found


def _solutions(model: Array, corners: Array) -> list[tuple[MatLike, MatLike]]:
    """Return rotation vectors [rad] and translations [m] of the two possible poses by IPPE. Where
    both are the same, IPPE would divide by zero: then return one pose, found by iteration. The list
    is empty if that fails, too.
    """
    given = model, corners[:, None], np.eye(3), None
    for method in (cv2.SOLVEPNP_IPPE, cv2.SOLVEPNP_ITERATIVE):
        _, turned, moved, _ = cv2.solvePnPGeneric(*given, flags=method)
        if turned and np.isfinite(turned).all() and np.isfinite(moved).all():
            return list(zip(turned, moved, strict=True))
    return []


def _prior_cost(pose: Pose, expected: Pose | None) -> float:
    """Return the part of a pose's cost that does not come from the corners: the squared angle of
    the rotation between the pose and the expected one, over its variance `TURN`^2; without an
    expected pose, the squared angle between the normal and the optical axis over `TILT`^2.
    """
    if expected is None:
        return float((np.arccos(np.clip(pose.rotation[2, 2], -1, 1)) / TILT) ** 2)
    cosine = (float(np.vdot(expected.rotation, pose.rotation)) - 1) / 2
    return float((np.arccos(np.clip(cosine, -1, 1)) / TURN) ** 2)


def refined(pose: Pose, corners: Array, size: tuple[float, float]) -> Pose:
    """Return the pose T_camera_object [m] that fits the corners of a rectangle best, found by
    Levenberg-Marquardt iteration.

    Args:
        pose: Pose T_camera_object from which the iteration starts.
        corners: Corners (4, 2) in normalised image coordinates, in the order rear left, front left,
            front right, rear right.
        size: Length along x and width along y of the rectangle [m].
    """
    vector, t = cv2.solvePnPRefineLM(
        UNIT * (*size, 0.0),
        corners[:, None],
        np.eye(3),
        None,
        cv2.Rodrigues(pose.rotation)[0],
        pose.translation[:, None].copy(),
    )
    return Pose(cv2.Rodrigues(vector)[0].astype(np.float64), t.ravel().astype(np.float64))
