"""Joints at the ends of their ranges: they leave the solution, and the law goes on with what the
others can do.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from servo.controllers._bounds import Bounds, inverse_of, range_bounds
from servo.types import DOF
from sim.types import Array, Posture

ROUNDING = 1e-9
"""Largest excess over a bound that rounding explains [m/s or rad/s]."""
WEAK = 0.02
"""A direction in which joints move the camera by less than this, over their rates, is closed to
them: the drives damp it, too [m/s or rad/s]."""


@dataclass(frozen=True, slots=True)
class RangeEnds:
    """The joints that the ends of their ranges hold."""

    jacobian: Array
    """Camera twist per joint rate (6, n)."""
    bounds: Bounds
    """Of the ranges."""
    rates: Array
    """How fast the joints that are held may still be (n,) [m/s or rad/s]; nan for the others."""

    @staticmethod
    def of(posture: Posture, way: Array, dt: float) -> "RangeEnds | None":
        """Return those of a robot, with no joint that is held; None where it has no ranges.

        Args:
            posture: The robot.
            way: What the camera still moves (6,) before the twist acts [m, rad].
            dt: Time since the last frame [s].
        """
        bounds = range_bounds(posture, way, dt)
        if bounds is None:
            return None
        return RangeEnds(posture.jacobian, bounds, np.full(len(bounds.A), np.nan))

    @property
    def held(self) -> NDArray[np.bool_]:
        """True for the joints (n,) that are held."""
        return ~np.isnan(self.rates)

    def holding(self, twist: Array) -> "RangeEnds":
        """Return these with the joints too that a twist (6,) would take beyond their ranges; the
        same object where there is none.
        """
        needed = self.rates.copy()
        free = ~self.held
        needed[free] = inverse_of(self.jacobian[:, free]) @ (twist - self._made())
        allowed = needed.clip(self.bounds.lower, self.bounds.upper)
        over = free & (np.abs(needed - allowed) > ROUNDING)
        return replace(self, rates=np.where(over, allowed, self.rates)) if over.any() else self

    def left(self, moves: NDArray[np.bool_]) -> tuple[Array, Array] | None:
        """Return twists (6, m) that span what the other joints can do, and the twist (6,) that
        those that are held still make; None where the others can do all that may move.

        Args:
            moves: Degrees of freedom (6,) that may move, of a robot of six joints or more: all that
                the others can do would also tilt a camera that is to stay level.
        """
        others = self.jacobian[:, ~self.held]
        made = self._made()
        if self.jacobian.shape[1] < len(DOF):
            return others, made
        basis, strengths, _ = np.linalg.svd(others)
        closed = basis[:, int((strengths > WEAK).sum()) :].T
        if not len(closed):
            return None
        moving = np.eye(len(DOF))[:, moves]
        U, strengths, Vt = np.linalg.svd(closed @ moving)
        rank = int((strengths > WEAK).sum())
        rest = (U.T @ closed @ made)[:rank] / strengths[:rank]
        return moving @ Vt[rank:].T, moving @ Vt[:rank].T @ rest

    def _made(self) -> Array:
        return self.jacobian[:, self.held] @ self.rates[self.held]
