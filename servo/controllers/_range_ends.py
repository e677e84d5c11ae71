"""Joints that are held at an end of their range, so that the law goes on with the other joints
alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from servo.controllers._bounds import Bounds, inverse_of, range_bounds
from servo.types import DOF
from sim.types import Array, Posture

ROUNDING = 1e-9
"""Largest excess over a bound that counts as rounding error [m/s or rad/s]."""
WEAK = 0.02
"""Singular value of the Jacobian from which the joints count as able to move the camera in its
direction [m/s or rad/s of the camera per unit of joint rate]; the drives damp such directions
below it, too."""


@dataclass(frozen=True, slots=True)
class RangeEnds:
    """Bounds of the joint rates by the joints' ranges, and the rates of the joints that are held at
    an end of their range.
    """

    jacobian: Array
    """Camera twist per joint rate (6, n)."""
    bounds: Bounds
    """Bounds of the joint rates by the ranges."""
    rates: Array
    """Rates (n,) of the held joints [m/s or rad/s]; nan for free joints."""

    @staticmethod
    def of(posture: Posture, way: Array, dt: float) -> "RangeEnds | None":
        """Return the range ends of a robot, with no joint held yet; None if it has no joints, or no
        finite Jacobian.

        Args:
            posture: Joints, limits and Jacobian of the robot.
            way: Displacement (6,) of the camera until the twist acts, which earlier commands cause
                [m, rad].
            dt: Time since the last picture [s].
        """
        bounds = range_bounds(posture, way, dt)
        if bounds is None:
            return None
        return RangeEnds(posture.jacobian, bounds, np.full(len(bounds.A), np.nan))

    @property
    def held(self) -> NDArray[np.bool_]:
        """True (n,) for each joint that is held at an end of its range."""
        return ~np.isnan(self.rates)

    def holding(self, twist: Array) -> "RangeEnds":
        """Return new range ends that also hold each joint which a camera twist (6,) [m/s, rad/s]
        would move out of its range; the same object if there is no such joint.
        """
        held = self.held
        free = ~held
        needed = self.rates.copy()
        if held.any():
            needed[free] = inverse_of(self.jacobian[:, free]) @ (twist - self._made())
        else:
            needed[:] = self.bounds.A @ twist
        allowed = needed.clip(self.bounds.lower, self.bounds.upper)
        over = free & (np.abs(needed - allowed) > ROUNDING)
        return replace(self, rates=np.where(over, allowed, self.rates)) if over.any() else self

    def left(self, moves: NDArray[np.bool_]) -> tuple[Array, Array] | None:
        """Return camera twists (6, m) that span the motions of the joints that are not held, and
        the camera twist (6,) that the held joints make.

        For a robot of six or more joints the first span only the allowed ones of these motions, and
        the second is the allowed twist of least norm with all of the held joints' motion that the
        other joints cannot make or cancel. The result is then None if the other joints can make
        every camera twist.

        Args:
            moves: True (6,) for each component of the camera twist that may move. Used only for
                robots of six or more joints, whose free joints alone would tilt a camera that has
                to stay level.
        """
        others = self.jacobian[:, ~self.held]
        made = self._made()
        if self.jacobian.shape[1] < len(DOF):
            return others, made
        # Directions that are closed to the free joints, as rows.
        basis, strengths, _ = np.linalg.svd(others)
        closed = basis[:, int((strengths > WEAK).sum()) :].T
        if not len(closed):
            return None
        # Of the allowed motions those that need no closed direction, and the part of the held
        # joints' twist that lies in one.
        moving = np.eye(len(DOF))[:, moves]
        U, strengths, Vt = np.linalg.svd(closed @ moving)
        rank = int((strengths > WEAK).sum())
        rest = (U.T @ closed @ made)[:rank] / strengths[:rank]
        return moving @ Vt[rank:].T, moving @ Vt[:rank].T @ rest

    def _made(self) -> Array:
        return self.jacobian[:, self.held] @ self.rates[self.held]
