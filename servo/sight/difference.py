"""How an error changes beyond what the camera's own motion explains (Teuliere, Marchand, Eck,
equation 18).
"""

from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.parts import FeatureSet
from sim.types import Array


@final
class Difference:
    """(e_k - e_{k-1}) / dt - L v, where v is the camera's measured motion over that very interval.

    Pairing the difference with the last command instead, one frame off, makes the loop diverge.
    """

    def __init__(self, features: FeatureSet) -> None:
        self._features = features
        self.forget()
        self.value = np.zeros(len(features.names))

    def measure(self, error: Array, own: Array, dt: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return the difference (k,) after a frame, and for which features it is new: those that
        were measured, not nan, in this frame and in the last one. The others keep theirs, at first
        zero.
        """
        fresh = np.isfinite(error) & np.isfinite(self._last)
        now, last = (np.where(fresh, e, 0.0) for e in (error, self._last))
        self.value = np.where(fresh, self._features.error(now, last) / dt - own, self.value)
        self._last = error
        return self.value, fresh

    def forget(self) -> None:
        """Begin the next difference anew: the target was not seen."""
        self._last = np.full(len(self._features.names), np.nan)
