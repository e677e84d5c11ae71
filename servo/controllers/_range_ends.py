"""Joints at the ends of their ranges, of a robot of few joints: they leave the solution, and the
law goes on with what the others can do.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from servo.controllers._bounds import Bounds, inverse_of, range_bounds
from sim.types import Array, Posture

ROUNDING = 1e-9
"""Largest excess over a bound that rounding explains [m/s or rad/s]."""


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

    @property
    def others(self) -> Array:
        """Camera twist per rate of each joint that is not held (6, m)."""
        return self.jacobian[:, ~self.held]

    @property
    def twist(self) -> Array:
        """The twist (6,) that the joints that are held still make."""
        return self.jacobian[:, self.held] @ self.rates[self.held]

    def holding(self, twist: Array) -> "RangeEnds":
        """Return these with the joints too that a twist (6,) would take beyond their ranges; the
        same object where there is none.
        """
        needed = self.rates.copy()
        needed[~self.held] = inverse_of(self.others) @ (twist - self.twist)
        allowed = needed.clip(self.bounds.lower, self.bounds.upper)
        over = ~self.held & (np.abs(needed - allowed) > ROUNDING)
        return replace(self, rates=np.where(over, allowed, self.rates)) if over.any() else self
