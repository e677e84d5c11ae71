"""Lens distortion: where a ray of light lands in the image, and which ray lands there.

A ray is given by its pinhole coordinates (x, y) = (X/Z, Y/Z). A model bends them, and the focal
lengths and the principal point take the result to pixels. With p = (p2, p1), q = x^2 + y^2 and
t = atan sqrt(q), in OpenCV's order of coefficients:

    plumb_bob  k1 k2 p1 p2 k3           (x, y) (f + 2 (x, y) p) + q p
                                        with f = 1 + k1 q + k2 q^2 + k3 q^3
    rational   k1 k2 p1 p2 k3 k4 k5 k6  the same with f / (1 + k4 q + k5 q^2 + k6 q^3)
    fisheye    k1 k2 k3 k4              (x, y) t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) / sqrt(q)

D. C. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32(3), 1966; D. Claus
and A. W. Fitzgibbon, "A rational function lens distortion model for general cameras", CVPR 2005;
J. Kannala and S. S. Brandt, "A generic camera model and calibration method for conventional,
wide-angle, and fish-eye lenses", TPAMI 28(8), 2006.
"""

import functools
from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sim.ranges import check

Array = NDArray[np.float64]
Model = Literal["plumb_bob", "rational", "fisheye"]
COEFFICIENTS: dict[Model, int] = {"plumb_bob": 5, "rational": 8, "fisheye": 4}
"""Number of coefficients of a model."""
WIDEST = 85.0
"""Largest angle between a ray and the optical axis [deg]: a flat picture cannot show much more."""
RADII = 2048
"""Number of radii at which a model is examined for folds."""
DIRECTIONS = 64
"""Number of directions in which a model is examined at each of these radii."""
BEFORE_FOLD = 0.97
"""`Distortion.reach` relative to the radius at which a model folds back."""
TINY = 1e-4
"""Smallest radius at which the fisheye's formula is evaluated; below, its factor is constant."""
UNIT = np.eye(2)
ROUNDS = 60
"""Most steps of Newton's method, far above what a lens without a fold needs."""
EXACT = 1e-6
"""Newton's method ends after a smaller step, which leaves an error of about its square."""


@dataclass(frozen=True, slots=True)
class Distortion:
    """The distortion model of a lens: the name of its formula, and the coefficients in OpenCV's
    order.

    At a large radius a polynomial may fold back: two rays would meet in one pixel. Rays beyond the
    radius `reach` are therefore bent by the factor that holds at `reach`, so that points far
    outside the picture stay outside.

    Raises:
        ValueError: The model is unknown, or the coefficients have a wrong number or are not finite.
    """

    model: Model
    """Name of the formula."""
    coefficients: tuple[float, ...]
    """Coefficients of the formula, in OpenCV's order."""

    def __post_init__(self) -> None:
        wanted = COEFFICIENTS.get(self.model)
        found = len(self.coefficients)
        check(
            (
                wanted is None,
                f"there is no distortion '{self.model}'; there is {', '.join(COEFFICIENTS)}",
            ),
            (
                not all(map(isfinite, self.coefficients)),
                f"the distortion {self.model} has a coefficient that is not finite: correct it",
            ),
            (
                found != wanted,
                f"the distortion {self.model} has {wanted} coefficients, not {found}",
            ),
        )

    @property
    def reach(self) -> float:
        """Largest radius sqrt(x^2 + y^2) of undistorted normalised coordinates for which the
        model's formula is used: a little less than where it folds back, and at most the tangent of
        85 deg.
        """
        return float(_radii(self)[0][-1])

    @property
    def folds(self) -> bool:
        """True if the formula folds back within 85 deg of the optical axis, that is, if it maps two
        rays to one pixel there.
        """
        return self.reach < np.tan(np.radians(WIDEST))

    def bend(self, rays: Array) -> Array:
        """Return the distorted normalised image coordinates (..., 2) of undistorted ones (..., 2),
        which are x = X/Z, y = Y/Z in the camera frame. Beyond the radius `reach` the distorted
        coordinates grow in proportion to the radius.
        """
        return _extended(self, rays)[0]

    def straighten(self, bent: Array) -> Array:
        """Return the undistorted normalised image coordinates (..., 2), x = X/Z, y = Y/Z in the
        camera frame, of distorted ones (..., 2): the inverse of `bend`, by Newton's method.
        """
        radii, lengths = _radii(self)
        length = np.hypot(bent[..., 0], bent[..., 1])
        radius = np.interp(length, lengths, radii) * np.maximum(length / lengths[-1], 1.0)
        rays = bent * (radius / np.maximum(length, TINY**2))[..., None]
        for _ in range(ROUNDS):
            found, slopes = _extended(self, rays)
            # The step solves [a b; c d] step = [x y] in closed form, for all rays at once.
            (a, b), (c, d) = np.moveaxis(slopes, (-2, -1), (0, 1))
            x, y = np.moveaxis(bent - found, -1, 0)
            step = np.stack([d * x - b * y, a * y - c * x], axis=-1) / (a * d - b * c)[..., None]
            rays = rays + step
            if np.all(np.abs(step) <= EXACT * (1.0 + np.abs(rays))):
                break
        return rays


def _extended(lens: Distortion, rays: Array) -> tuple[Array, Array]:
    """Return the distorted coordinates (..., 2) of rays (..., 2), beyond the model's reach in
    proportion to the radius, and their Jacobian (..., 2, 2).
    """
    reach = lens.reach
    beyond = np.maximum(np.hypot(rays[..., 0], rays[..., 1]) / reach, 1.0)[..., None]
    inner = rays / beyond
    bent, slopes = _bent(lens, inner)
    if beyond.max(initial=1.0) > 1.0:
        # The chain rule through inner = rays reach / |rays|, whose derivative along d is zero.
        d = inner / reach  # unit vectors, where it is needed
        along = bent / reach - np.einsum("...ij,...j->...i", slopes, d)
        slopes = np.where(
            beyond[..., None] > 1.0, slopes + along[..., :, None] * d[..., None, :], slopes
        )
    return bent * beyond, slopes


def _bent(lens: Distortion, rays: Array) -> tuple[Array, Array]:
    """Return the distorted coordinates (..., 2) of rays by the model's formula, and their Jacobian
    (..., 2, 2).
    """
    q = rays[..., 0] ** 2 + rays[..., 1] ** 2
    f, slope = _radial(lens, q)
    p = np.zeros(2) if lens.model == "fisheye" else np.array(lens.coefficients[3:1:-1])
    factor = (f + 2 * rays @ p)[..., None]
    along = 2 * (slope[..., None] * rays + p)
    slopes = rays[..., :, None] * along[..., None, :]
    slopes += 2 * p[:, None] * rays[..., None, :] + factor[..., None] * UNIT
    return rays * factor + q[..., None] * p, slopes


def _radial(lens: Distortion, q: Array) -> tuple[Array, Array]:
    """Return the radial factor on (x, y) at squared radii q (...), and its derivative by q."""
    c = lens.coefficients
    if lens.model == "fisheye":
        q = np.maximum(q, TINY**2)
        r = np.sqrt(q)
        t = np.arctan(r)
        g, slope = _polynomial(t * t, (1.0, *c))
        g, by_t = t * g, g + 2 * t * t * slope
        return g / r, (by_t / (1 + q) - g / r) / (2 * q)
    top, by_q = _polynomial(q, (1.0, c[0], c[1], c[4]))
    if lens.model == "plumb_bob":
        return top, by_q
    bottom, below = _polynomial(q, (1.0, *c[5:]))
    return top / bottom, (by_q * bottom - top * below) / bottom**2


def _polynomial(x: Array, coefficients: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the value and the derivative of a polynomial at x, by Horner's rule; the first of its
    coefficients is the constant term.
    """
    value = coefficients[-1]
    slope = 0.0
    for c in coefficients[-2::-1]:
        slope = slope * x + value
        value = value * x + c
    return value, slope  # type: ignore[return-value]


@functools.lru_cache(maxsize=64)
def _radii(lens: Distortion) -> tuple[Array, Array]:
    """Return radii (n,) of undistorted normalised coordinates, from 0 to the model's reach, and the
    radii (n,) to which the radial terms alone (without p1 and p2) distort them.
    """
    radii = np.tan(np.radians(np.linspace(0.0, WIDEST, RADII)))
    turn = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    with np.errstate(all="ignore"):  # a pole of the rational model
        rays = radii[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        slopes = _bent(lens, rays)[1]
        det = slopes[..., 0, 0] * slopes[..., 1, 1] - slopes[..., 0, 1] * slopes[..., 1, 0]
        # With positive determinant and trace the picture is neither folded nor turned over.
        right = np.all((det > 0) & (slopes[..., 0, 0] + slopes[..., 1, 1] > 0), axis=1)
        lengths = radii * _radial(lens, radii**2)[0]
        right[1:] &= np.diff(lengths) > 0
    if not right.all():
        radii = radii * (BEFORE_FOLD * max(radii[np.argmin(right) - 1], TINY) / radii[-1])
        lengths = radii * _radial(lens, radii**2)[0]
    return radii, lengths
