"""The weighted pseudo-inverse of an interaction matrix, and the motions that it leaves free."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from sim.geometry import inverse_if_strong
from sim.types import Array

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero."""


@dataclass(frozen=True, slots=True)
class Inverse:
    """What takes a wanted de/dt to a camera twist."""

    pseudo: Array
    """L# (6, 4): of all twists that give the wanted de/dt, the one least in weighted norm."""
    L: Array
    """The interaction matrix (4, 6) itself."""
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
        """The inverse over some features and some degrees of freedom.

        W (L W)+ minimises |W^-1 v|: a degree of freedom with a small weight moves little, with the
        weight zero not at all. Only the ratios of the weights matter.

        Args:
            L: Interaction matrix (4, 6).
            rows: Features (4,) that are known; the others get no say.
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
    """The pseudo-inverse; of a square matrix that is strong enough, the plain inverse."""
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
