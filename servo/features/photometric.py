"""Brightness of all pixels against the goal's, no tracker (Collewet, Marchand 2011)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from servo.mistake import Mistake
from servo.sight.point_rows import point_rows
from servo.types import CameraImage, Sight
from sim.channels import Channel
from sim.types import Array

BORDER = 10
"""Pixels this near to the picture's edge are left out."""
TAPS = np.array([-112, -913, -2047, 0, 2047, 913, 112]) / 8418
"""Derivative filter along a row or a column."""
RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero."""


@dataclass(frozen=True, slots=True)
class Config:
    """No settings; the pixels' interaction matrix is taken at the goal."""

    needs = frozenset({Channel.PICTURE, Channel.GOAL_PICTURE})

    def build(self, outline: Array) -> "PhotometricFeatures":
        """Return the features of any picture."""
        return PhotometricFeatures()


@final
class PhotometricFeatures:
    """s = L+ (I - I*) (6,): what the camera's six degrees of freedom explain of the difference of
    the pixels' brightness I and I*. So ds/dt is the camera's twist, to first order.

    Collewet and Marchand 2011 (Photometric visual servoing, IEEE Transactions on Robotics 27). One
    depth stands for all pixels. It needs texture, light that stays, and a start near the goal.
    """

    names = ("x", "y", "z", "rx", "ry", "rz")
    units = (*(("m",) * 3), *(("rad",) * 3))
    feed_forward = ()
    sole_dof: Mapping[str, str] = {}
    noise = np.full(6, 1e-4)

    def __init__(self) -> None:
        self._goal: Sight | None = None
        self._goal_inverse = np.zeros((6, 0))

    def values(self, sight: Sight) -> Array:
        """Return s (6,)."""
        goal = sight.aim
        if goal is not self._goal:
            L = brightness_matrix(_picture(goal), 1 / goal.plane.C)
            self._goal = goal
            self._goal_inverse = np.linalg.pinv(L, rcond=RANK_TOLERANCE).astype(np.float64)
        e = (brightness(_picture(sight)) - brightness(_picture(goal))).ravel()
        return self._goal_inverse @ e

    def matrix(self, sight: Sight) -> Array:
        """Return the identity (6, 6)."""
        return np.eye(6)

    def error(self, values: Array, goal: Array) -> Array:
        """Return e = s - s* (6,)."""
        return values - goal

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return six flags: all are known."""
        return np.full(6, True)

    def scales(self, goal: Array) -> Array:
        """Return ones (6,)."""
        return np.ones(6)


def brightness(picture: CameraImage) -> Array:
    """Return the grey values (h, w) of the pixels that count."""
    return _inside(_grey(picture))


def brightness_matrix(picture: CameraImage, depth: float) -> Array:
    """Return the interaction matrix (h w, 6) of the grey values: L = -(Ix Lx + Iy Ly), with the
    rows of the pixels as points (Collewet and Marchand 2011, equation 9).

    Args:
        picture: What is seen.
        depth: Of all pixels [m].
    """
    grey = _grey(picture)
    camera = picture.camera
    one = np.ones(1)
    along_u, along_v = (
        _inside(np.asarray(cv2.sepFilter2D(grey, cv2.CV_64F, x, y), np.float64))
        for x, y in ((TAPS, one), (one, TAPS))
    )
    v, u = np.indices(grey.shape) + 0.5
    seen = camera.normalise(np.stack([u, v], axis=-1))
    xv, yv = (_inside(np.asarray(np.gradient(seen[..., k], axis=0))) for k in (0, 1))
    xu, yu = (_inside(np.asarray(np.gradient(seen[..., k], axis=1))) for k in (0, 1))
    size = xu * yv - xv * yu
    Ix = ((yv * along_u - yu * along_v) / size).ravel()
    Iy = ((xu * along_v - xv * along_u) / size).ravel()
    x, y = (_inside(seen[..., axis]).ravel() for axis in (0, 1))
    Lx, Ly = point_rows(x, y, np.full_like(x, 1 / depth))
    return -(Ix[:, None] * Lx + Iy[:, None] * Ly)


def _grey(picture: CameraImage) -> Array:
    return cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY).astype(np.float64)


def _inside(whole: Array) -> Array:
    if min(whole.shape) <= 2 * BORDER:
        raise Mistake(
            f"a picture of {whole.shape[1]} x {whole.shape[0]} px is too small for features made "
            f"of pixels, which leave out {BORDER} px at each side"
        )
    return whole[BORDER:-BORDER, BORDER:-BORDER]


def _picture(sight: Sight) -> CameraImage:
    if sight.picture is None:
        raise ValueError("there is no picture of the goal; give Loop.start one")
    return sight.picture
