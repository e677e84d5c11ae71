"""Camera motion between two pictures of a plane, computed from the homography between them."""

from collections.abc import Sequence
from typing import final

import cv2
import numpy as np

from sim.geometry import exp_so3
from sim.types import Array

SMALL = 0.02
"""Homographies this near to the identity (largest singular value of the difference) are linearised:
OpenCV takes still nearer ones for pure rotations."""
NEARLY_TURNED = 0.003
"""Homographies this near to a rotation (largest singular value of the difference) may be pure
rotations to OpenCV, without a plane: it finds one from 0.0016 on."""

Motion = tuple[Array, Array, Array]
"""Rotation R (3, 3), translation over the plane's distance t (3,) and unit normal n (3,) of a
homography H ~ R + t n^T. n is in the first camera's frame, and points away from the camera."""


@final
class PlaneMotion:
    """Computes camera motions from the homographies between one picture of a plane and successive
    others. Two motions explain each homography; the plane's normal in the first picture is the same
    in all true ones, and this decides between them.
    """

    def __init__(self) -> None:
        self._paths: list[tuple[Array, float]] = [(np.array([0.0, 0.0, 1.0]), 0.0)]
        """Normals that are possible so far, and what their changes have cost [rad^2]. The first
        picture decides by the smallest tilt of the plane."""

    def of(self, H: Array) -> Motion | None:
        """Return the motion (R, t, n) that explains a homography H ~ R + t n^T: rotation (3, 3) and
        translation over the plane's distance from the first camera (3,), which take coordinates in
        the first camera's frame to the other's, and the plane's unit normal (3,) in the first
        camera's frame, away from the camera. The result is None if the plane would be behind a
        camera. Call it for each picture, in order.

        Args:
            H: Homography (3, 3) from the first picture to another one, in normalised image
                coordinates, of any scale.
        """
        scaled = H / np.linalg.svd(H, compute_uv=False)[1] * np.sign(np.linalg.det(H))
        if np.linalg.norm(scaled - np.eye(3), 2) < SMALL:
            return _small(scaled, min(self._paths, key=lambda path: path[1])[0])
        found = _motions(scaled)
        if not found:
            return self._nearly_turned(scaled)
        costs = [
            min(cost + _angle(normal, before) ** 2 for before, cost in self._paths)
            for _, _, normal in found
        ]
        normals = [normal for _, _, normal in found]
        self._paths = list(zip(normals, costs, strict=True))
        return found[costs.index(min(costs))]

    def _nearly_turned(self, H: Array) -> Motion | None:
        """Return the motion of a homography (3, 3) near to a rotation, for which OpenCV gives no
        plane; None for any other homography. The plane's normal is the likeliest one so far.
        """
        before, _, after = np.linalg.svd(H)
        R = before @ after
        # The last term is not above zero where the plane would be behind a camera.
        if np.linalg.norm(H - R, 2) > NEARLY_TURNED or H[2, 2] <= 0:
            return None
        normal, _ = min(self._paths, key=lambda path: path[1])
        turn, shift, _ = _small(H @ R.T, R @ normal)
        return turn @ R, shift, normal


def _motions(H: Array) -> Sequence[Motion]:
    """Return the motions that explain a homography (3, 3), without those in which the middle of the
    picture would be behind a camera.

    Malis and Vargas 2007 (Deeper understanding of the homography decomposition for vision-based
    control, INRIA research report 6303).
    """
    _, turns, shifts, normals = cv2.decomposeHomographyMat(H, np.eye(3))
    found = list[Motion]()
    for R, t, n in zip(turns, shifts, normals, strict=True):
        turn, shift, normal = (np.asarray(each, np.float64) for each in (R, t.ravel(), n.ravel()))
        if normal[2] > 0 and (turn + np.outer(shift, normal))[2, 2] > 0:
            found.append((turn, shift, normal))
    return found


def _small(H: Array, normal: Array) -> Motion:
    """Return the camera motion for which a plane with a given unit normal (3,) in the first
    camera's frame has a homography H (3, 3) near to the identity, by least squares: H - I = [w]x +
    t n^T.
    """
    cross = np.array([np.cross(axis, np.eye(3)).T for axis in np.eye(3)])
    columns = [*cross, *(np.outer(axis, normal) for axis in np.eye(3))]
    rows = np.array([column.ravel() for column in columns]).T
    found = np.asarray(np.linalg.lstsq(rows, (H - np.eye(3)).ravel())[0], np.float64)
    return exp_so3(found[:3]), found[3:], normal


def _angle(first: Array, second: Array) -> float:
    """Return the angle between two unit vectors (3,) [rad]."""
    return float(np.arccos(np.clip(first @ second, -1.0, 1.0)))
