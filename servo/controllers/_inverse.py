"""The weighted pseudo-inverse of an interaction matrix, and the motions that it leaves free."""

from __future__ import annotations

from dataclasses import dataclass

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
    chosen: Array
    """L (4, 6) without what has no say: its rows and columns are zero."""
    moves: NDArray[np.bool_]
    """Degrees of freedom (6,) that may move."""

    @property
    def free(self) -> Array:
        """I - L# L (6, 6): takes any twist to the part of it that changes no feature."""
        return np.diag(self.moves.astype(float)) - self.pseudo @ self.chosen

    @staticmethod
    def of(L: Array, rows: NDArray[np.bool_], moves: NDArray[np.bool_], weights: Array) -> Inverse:
        """The inverse over some features and some degrees of freedom.

        W (L W)+ minimises |W^-1 v|: a degree of freedom with a small weight moves little, with the
        weight zero not at all.

        Args:
            L: Interaction matrix (4, 6).
            rows: Features (4,) that are known; the others get no say.
            moves: Degrees of freedom (6,) that may move.
            weights: Weights (6,) of the degrees of freedom.
        """
        chosen = L * rows[:, None] * moves  # what is left out is zero, and so is its inverse
        weighted = chosen * weights
        pseudo = weights[:, None] * _pinv(weighted, moves if rows.all() else None)
        return Inverse(pseudo, chosen, moves)


def _pinv(A: Array, moves: NDArray[np.bool_] | None) -> Array:
    """The pseudo-inverse; where all rows and as many columns (`moves`) count, the plain one."""
    if moves is not None and np.count_nonzero(moves) == len(A):
        size = float(np.sqrt(np.vdot(A, A)))
        plain = inverse_if_strong(A[:, moves], RANK_TOLERANCE * size)
        if plain is not None:
            whole = np.zeros(A.T.shape)
            whole[moves] = plain
            return whole
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    large = s > RANK_TOLERANCE * s[0]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=large)
    return (Vt.T * inverse) @ U.T
