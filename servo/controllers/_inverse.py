"""Weighted pseudo-inverse L# of an interaction matrix, and secondary tasks for its null space, the
camera twists that change no feature.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from servo.types import DOF
from sim.geometry import inverse_if_strong
from sim.types import Array, Posture

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero: far above rounding errors, far
below the ratios between features of different units."""
INDEPENDENT = 0.05
"""A feature is servoed if the joints can move it, without moving the features before it, by more
than this share of what a free camera could; chosen by hand."""
Secondary = Literal["level", "avoid_limits", "centre"]
FAR = 0.75
"""Distance of a joint from mid-range, over half its range, from which it is near its limit (the
threshold of Chaumette and Marchand 2001)."""


@dataclass(frozen=True, slots=True)
class Inverse:
    """Pseudo-inverse L# of an interaction matrix: it maps a desired de/dt of the features to a
    camera twist.
    """

    pseudo: Array
    """L# (6, k), which maps a desired de/dt (k,) to a camera twist; its columns are zero for
    features that are not servoed."""
    L: Array
    """The interaction matrix (k, 6) itself."""
    moves: NDArray[np.bool_]
    """Degrees of freedom (6,) that may move."""
    span: Array | None = None
    """Camera twists (6, n) that span those of the joints; None: the joints make any twist."""
    is_own: bool = False
    """Whether L# is a feature set's own inverse: L# L may then be no projection."""

    @property
    def free(self) -> Array:
        """Projection I - L# L (6, 6), which maps a camera twist to its part that changes no servoed
        feature and that the joints can make. Rows and columns of degrees of freedom that may not
        move are zero.
        """
        pseudo = _pinv(self.L) if self.is_own else self.pseudo
        free = (np.eye(len(self.moves)) - pseudo @ self.L) * self.moves
        return free if self.span is None else free @ self.span @ np.linalg.pinv(self.span)

    @staticmethod
    def through_joints(L: Array, rows: NDArray[np.bool_], jacobian: Array) -> "Inverse":
        """Return the inverse J (L J)+ for a robot with fewer than six joints that can move: the
        joint rates whose features come nearest, by least squares, to the desired de/dt, mapped to
        the camera twist that they make.

        Args:
            L: Interaction matrix (k, 6).
            rows: True (k,) for each feature that is servoed; the others have columns of zero.
            jacobian: J (6, n), camera twist per joint rate; or n camera twists (6,) that span the
                motions left to the joints.
        """
        pseudo = np.zeros(L.shape[::-1])
        pseudo[:, rows] = jacobian @ _pinv(L[rows] @ jacobian)
        return Inverse(pseudo, L, np.ones(len(DOF), bool), jacobian)

    @staticmethod
    def of(
        L: Array, rows: NDArray[np.bool_], moves: NDArray[np.bool_], weights: Array
    ) -> "Inverse":
        """Return the inverse for the features and the degrees of freedom that are marked.

        With the weights W it is W (L W)+, which minimises |W^-1 v|: a degree of freedom with a
        small weight moves little, and one with the weight zero stands. Only the ratios of the
        weights matter.

        Args:
            L: Interaction matrix (k, 6).
            rows: True (k,) for each feature that is measured; the others have columns of zero.
            moves: True (6,) for each degree of freedom that may move.
            weights: Weights (6,) of the degrees of freedom, 0 or more.
        """
        (known,) = rows.nonzero()
        (moving,) = moves.nonzero()
        # Over the largest weight: only the ratios matter.
        w = weights[moving] / (weights[moving].max(initial=0.0) or 1.0)
        pseudo = np.zeros(L.shape[::-1])
        pseudo[moving[:, None], known] = w[:, None] * _pinv(L[known[:, None], moving] * w)
        return Inverse(pseudo, L, moves & (weights > 0))


def takes_own_inverse(known: NDArray[np.bool_], *, tilt_seen: bool) -> bool:
    """Return whether a feature set's own inverse, where it has one, replaces the pseudo-inverse for
    a picture: all features are measured, and so is the tilt of the target's plane if six or more
    features would turn the camera by a tilt that is only assumed.

    Args:
        known: True (k,) for each feature that is measured in the picture.
        tilt_seen: Whether the tilt of the target's plane is measured in it.
    """
    return bool(known.all()) and (tilt_seen or len(known) < len(DOF))


def servoed_by(L: Array, jacobian: Array) -> NDArray[np.bool_]:
    """Return True (k,) for each feature that the joints of a robot can servo. Of up to six
    features, these are the ones that the joints can move independently of the features before them
    in the set; more than six are all servoed, by least squares, and so are all features of a robot
    with six or more joints.

    Args:
        L: Interaction matrix (k, 6).
        jacobian: Camera twist per joint rate (6, n).
    """
    if jacobian.shape[1] >= len(DOF) or len(L) > len(DOF):
        return np.ones(len(L), bool)
    # Features move only in the span of the Jacobian: Gram-Schmidt over their rows in it.
    basis, strengths, _ = np.linalg.svd(jacobian, full_matrices=False)
    moved = L @ basis[:, strengths > RANK_TOLERANCE * strengths.max(initial=0.0)]
    servoed = np.zeros(len(L), bool)
    for i, row in enumerate(moved):
        others = moved[servoed]
        apart = row - row @ np.linalg.pinv(others) @ others if len(others) else row
        servoed[i] = np.linalg.norm(apart) > INDEPENDENT * np.linalg.norm(L[i])
    return servoed


def _pinv(A: Array) -> Array:
    """Return the Moore-Penrose pseudo-inverse (n, m) of a matrix (m, n): the plain inverse of a
    square matrix that is well-conditioned, else by singular values, of which those below 1e-6 of
    the largest count as zero.
    """
    if A.size == 0:
        return A.T
    if A.shape[0] == A.shape[1]:
        size = sqrt(np.vdot(A, A))
        plain = inverse_if_strong(A, RANK_TOLERANCE * size)
        if plain is not None:
            return plain
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    large = s > RANK_TOLERANCE * s[0]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=large)
    return (Vt.T * inverse) @ U.T


def level(posture: Posture) -> Array:
    """Return the camera twist (6,) of the secondary task "level", for a gain of 1 per second: its
    angular velocity z x down [rad/s] turns the optical axis z towards straight down; its linear
    part is zero.
    """
    x, y, _ = posture.down.tolist()
    return np.array([0.0, 0.0, 0.0, -y, x, 0.0])


def centre(posture: Posture) -> Array:
    """Return the camera twist (6,) [m/s, rad/s] of the secondary task "centre", for a gain of 1 per
    second: it moves all joints with limits towards the middle of their ranges.
    """
    limited, away, half = _ranges(posture)
    return -posture.jacobian[:, limited] @ (away * half)


def avoid_limits(posture: Posture) -> Array:
    """Return the camera twist (6,) [m/s, rad/s] of the secondary task "avoid_limits", for a gain of
    1 per second: it moves joints away from a limit that is near.

    With `away`, the distance of a joint from mid-range over half its range, each `away` changes at
    the rate -dh/d(away), where h = sum max(0, |away| - 0.75)^2 / 2 (after Chaumette and Marchand
    2001).
    """
    limited, away, half = _ranges(posture)
    excess = np.sign(away) * np.maximum(np.abs(away) - FAR, 0.0)
    return -posture.jacobian[:, limited] @ (excess * half)


def _ranges(posture: Posture) -> tuple[NDArray[np.intp], Array, Array]:
    """Return, for the m joints with a lower and an upper limit: their indices (m,), their positions
    in their ranges (m,) from -1 (lower limit) to 1 (upper limit), and half the lengths of their
    ranges (m,) [m or rad].
    """
    limited = np.flatnonzero(np.isfinite(posture.lower) & np.isfinite(posture.upper))
    low = posture.lower[limited]
    high = posture.upper[limited]
    half = (high - low) / 2
    return limited, (posture.joints[limited] - (low + high) / 2) / half, half


TASKS = {"level": level, "avoid_limits": avoid_limits, "centre": centre}


def twist_of(tasks: tuple[Secondary, ...], posture: Posture) -> Array:
    """Return the sum (6,) [m/s, rad/s] of the camera twists of secondary tasks, for a gain of 1 per
    second.
    """
    return sum((TASKS[name](posture) for name in tasks), start=np.zeros(6))
