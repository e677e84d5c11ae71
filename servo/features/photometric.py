"""Feature set of all pixels: their brightness against that of the goal's picture, without a tracker
(Collewet, Marchand 2011).
"""

from dataclasses import dataclass, replace
from math import floor, log2
from typing import Annotated, final

import cv2
import numpy as np
from annotated_types import Ge, Le

from servo.features._base import Features
from servo.features._pictures import picture_of
from servo.mistake import Mistake
from servo.sight.point_rows import point_rows
from servo.types import CameraImage, Sight
from sim.channels import Channel
from sim.types import Array

BORDER = 10
"""Width of the strip along each side of the picture whose pixels are left out [px]."""
TAPS = np.array([-112, -913, -2047, 0, 2047, 913, 112]) / 8418
"""Derivative filter along a row or a column."""
LEAST = 1e-3
"""Smallest difference of two pictures that counts [grey levels]."""
MOST_HALVINGS = 4
"""From so many halvings on nothing is blurred."""
RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the feature set `photometric`: the blur of both pictures far from the goal [px].

    The pixels' interaction matrix is taken at the goal.
    """

    blur: Annotated[float, Ge(0), Le(100)] = 0.0
    """Standard deviation of the blur of both pictures at the start [px]; it is halved when their
    difference is. Blurred pictures can be compared from farther away."""
    needs = frozenset({Channel.PICTURE, Channel.GOAL_PICTURE})

    def build(self, outline: Array) -> "PhotometricFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return PhotometricFeatures(self.blur)


@final
class PhotometricFeatures(Features):
    """Feature set s = L+ (I - I*) (6,): the camera's displacement from the goal [m, rad] that best
    explains the difference between the pixels' brightness I and that at the goal, I*, with the
    interaction matrix L of the pixels at the goal. So ds/dt is the camera twist, to first order.
    `blur` is the standard deviation of the blur of both pictures at the start [px].

    Collewet and Marchand 2011 (Photometric visual servoing, IEEE Transactions on Robotics 27). One
    depth stands for all pixels. The method needs texture, constant light, and a start near the
    goal. Blurring both pictures at first, and less and less, widens where it may start (Crombez,
    Mouaddib, Caron, Chaumette 2019, Visual servoing with photometric Gaussian mixtures as dense
    features, IEEE Transactions on Robotics 35, have the idea).
    """

    names = ("x", "y", "z", "rx", "ry", "rz")
    units = (*(("m",) * 3), *(("rad",) * 3))
    feed_forward = ()
    noise = np.full(6, 1e-4)

    def __init__(self, blur: float = 0.0) -> None:
        self._widest = blur
        self._goal: Sight | None = None
        self._first: float | None = None
        """Difference of both pictures at the start, rms [grey levels]."""
        self._blur: float | None = None
        self._blurred = np.zeros((0, 0))
        self._goal_inverse = np.zeros((6, 0))

    def values(self, sight: Sight) -> Array:
        """Return the features (6,) for the current picture: the displacement of the camera from its
        goal, to first order, as translation [m] and rotation vector [rad] in the camera frame.

        Args:
            sight: The current picture, and in its `goal` the picture and the target's depth at the
                goal.

        Raises:
            ValueError: One of the pictures is missing.
            Mistake: A picture has 20 px or less in width or height.
        """
        goal = sight.aim
        if goal is not self._goal:
            self._goal = goal
            self._first = self._blur = None
        blur = self._blur_for(sight, goal)
        if blur != self._blur:
            self._blur = blur
            pictured = _blurred(picture_of(goal), blur)
            L = brightness_matrix(pictured, 1 / goal.plane.C)
            self._blurred = brightness(pictured)
            self._goal_inverse = np.linalg.pinv(L, rcond=RANK_TOLERANCE).astype(np.float64)
        e = (brightness(_blurred(picture_of(sight), blur)) - self._blurred).ravel()
        return self._goal_inverse @ e

    def _blur_for(self, sight: Sight, goal: Sight) -> float:
        """Return the standard deviation of the blur for a picture [px]: the widest one, halved as
        often as the difference of both pictures has been since the start; 0 from four halvings on,
        and for the goal itself.
        """
        if self._widest == 0.0 or sight is goal:
            return 0.0
        apart = brightness(picture_of(sight)) - brightness(picture_of(goal))
        rms = float(np.sqrt(np.mean(apart**2)))
        if self._first is None:
            self._first = rms
        halvings = floor(log2(max(self._first, rms, LEAST) / max(rms, LEAST)))
        return self._widest / 2**halvings if halvings < MOST_HALVINGS else 0.0

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix (6, 6) of the features, which is always the identity: they
        are a displacement of the camera, so that their rate is the camera twist.
        """
        return np.eye(6)


def brightness(picture: CameraImage) -> Array:
    """Return the grey values (H - 20, W - 20), 0 to 255 as floats, of a picture (H, W, 3) without
    the 10 px next to each side.

    Raises:
        Mistake: The picture has 20 px or less in width or height.
    """
    return _inside(_grey(picture))


def brightness_matrix(picture: CameraImage, depth: float) -> Array:
    """Return the interaction matrix L (n, 6) of the grey values (0 to 255) of the n pixels of a
    picture, row by row, without the 10 px next to each side, for a camera twist in the camera frame
    [m/s, rad/s]. L = -(Ix Lx + Iy Ly), with Lx and Ly the interaction matrices of each pixel's
    coordinates, and Ix and Iy the gradient of the grey values in normalised image coordinates
    (Collewet and Marchand 2011, equation 9).

    Args:
        picture: The picture, with its camera.
        depth: Depth of all pixels [m].

    Raises:
        Mistake: The picture has 20 px or less in width or height.
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


def _blurred(picture: CameraImage, blur: float) -> CameraImage:
    """Return a picture after a Gaussian blur of a standard deviation [px]."""
    if blur == 0.0:
        return picture
    image = np.asarray(cv2.GaussianBlur(picture.image, (0, 0), blur), np.uint8)
    return replace(picture, image=image)


def _grey(picture: CameraImage) -> Array:
    return cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY).astype(np.float64)


def _inside(whole: Array) -> Array:
    if min(whole.shape) <= 2 * BORDER:
        raise Mistake(
            f"a picture of {whole.shape[1]} x {whole.shape[0]} px is too small for features made "
            f"of pixels, which leave out {BORDER} px at each side: set a larger camera.width and "
            "camera.height"
        )
    return whole[BORDER:-BORDER, BORDER:-BORDER]
