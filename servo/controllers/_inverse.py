"""The weighted pseudo-inverse of an interaction matrix, and the motions that it leaves free."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from sim.geometry import inverse_if_strong
from sim.types import Array

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero: far above rounding, far below
what features of different units differ by."""


@dataclass(frozen=True, slots=True)
class Inverse:
    """The map from a desired de/dt to a camera twist."""

    pseudo: Array
    """L# (6, k): of all twists that give the desired de/dt, the one least in weighted norm."""
    L: Array
    """The interaction matrix (k, 6) itself."""
    moves: NDArray[np.bool_]
    """Degrees of freedom (6,) that may move."""

    @property
    def free(self) -> Array:
        """I - L# L (6, 6), over what may move: takes any twist to the part of it that changes no
        feature.
        """
        return (np.eye(len(self.moves)) - self.pseudo @ self.L) * self.moves

    @staticmethod
    def of(L: Array, rows: NDArray[np.bool_], moves: NDArray[np.bool_], weights: Array) -> Inverse:
        """Return the inverse over some features and some degrees of freedom.

        W (L W)+ minimises |W^-1 v|: a degree of freedom with a small weight moves little, with the
        weight zero not at all. Only the ratios of the weights matter.

        Args:
            L: Interaction matrix (k, 6).
            rows: Features (k,) that are known; the others are left out.
            moves: Degrees of freedom (6,) that may move.
            weights: Weights (6,) of the degrees of freedom.
        """
        (known,) = rows.nonzero()
        (moving,) = moves.nonzero()
        w = weights[moving] / (weights[moving].max(initial=0.0) or 1.0)
        pseudo = np.zeros(L.shape[::-1])
        pseudo[moving[:, None], known] = w[:, None] * _pinv(L[known[:, None], moving] * w)
        return Inverse(pseudo, L, moves)


def _pinv(A: Array) -> Array:
    """Return the pseudo-inverse; of a square matrix that is strong enough, the plain inverse."""
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
