"""Refusal of impossible sizes in a tracker's estimates: sizes that change more than camera and
target can have moved.

A tracker whose boxes shrink while its centre stays right would make the law believe that the camera
is too far away, and drive it into the table. The camera's own motion towards the target is known,
and a target does not come nearer arbitrarily fast: together they bound the change of the size.
"""

import math
from dataclasses import replace
from typing import final

from tracking.types import Estimate, Status

FASTEST = 0.35
"""Fastest change of ln scale by the target's own motion [1/s]: a target that rises at 35 % of its
distance each second."""
LEAST_GATE = 0.12
"""Least deviation of ln scale from its prediction that is refused; chosen on the shipped scenarios,
in which no size of a shipped tracker is refused (tracking/RESULTS.md)."""
SIGMAS = 3.0
"""The gate in standard deviations of ln scale, where the tracker states one."""
BACK = 0.2
"""A size that was refused counts again after `WAIT` within this deviation from the prediction."""
WAIT = 1.0
"""Time for which a refused size must fit again [s]."""


@final
class SizeGate:
    """Finds sizes in a tracker's estimates that change more from picture to picture than camera and
    target can have moved, and computes a likely size to use instead. `scale` is the scale of the
    target in the first picture.
    """

    def __init__(self, scale: float) -> None:
        """Begin with the scale of the target in the first picture."""
        self._log = math.log(scale)
        self._unseen = 0.0
        """How much ln scale can have changed by the target's motion while it was not seen."""
        self._fits: float | None = None
        """Time for which a refused size has fitted again [s]; None while no size is refused."""

    def judged(self, estimate: Estimate, ego: float, interval: float) -> Estimate:
        """Return the estimate unchanged if its scale is possible, or if the law does not use it:
        the tracker does not see the target, does not follow its size, or reports its corners.
        Otherwise return a copy that has the scale to use instead as `likely_scale`. After such a
        refusal all scales are refused until they have been near the expected scale (within 0.2 of
        its logarithm) for 1 s. Call it once for each picture, in order.

        Args:
            estimate: The tracker's estimate of this picture.
            ego: Change of ln scale since the previous picture that the camera's own motion caused.
            interval: Time since the previous picture [s].
        """
        self._log += ego
        is_used = estimate.follows[1] and estimate.corners is None  # corners have a size themselves
        if estimate.status is not Status.LOCKED or not is_used:
            self._unseen += FASTEST * interval
            return estimate
        off = math.log(estimate.state.scale) - self._log
        if not self._accepts(off, float(estimate.covariance[3, 3]), interval):
            return replace(estimate, likely_scale=math.exp(self._log))
        most = FASTEST * interval + self._unseen
        # A size that was refused and fits again begins anew.
        self._log += off if self._fits is not None else min(max(off, -most), most)
        self._fits = None
        self._unseen = 0.0
        return estimate

    def _accepts(self, off: float, variance: float, interval: float) -> bool:
        """Return True if a deviation of ln scale from its prediction is possible; after a refusal,
        only once the deviations have been at most `BACK` for `WAIT` seconds.

        Args:
            off: The deviation.
            variance: Variance of ln scale that the tracker states; nan: none.
            interval: Time since the last picture [s].
        """
        if self._fits is not None:
            self._fits = self._fits + interval if abs(off) <= BACK else 0.0
            return self._fits >= WAIT
        stated = SIGMAS * math.sqrt(variance) if variance > 0 else 0.0  # nan is not
        if abs(off) <= max(LEAST_GATE, stated) + self._unseen:
            return True
        self._fits = 0.0
        return False
