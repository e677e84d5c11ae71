"""Rate of the feature error that the camera's own motion does not explain (Teuliere, Marchand, Eck,
equation 18).
"""

from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.parts import FeatureSet
from sim.types import Array


@final
class Difference:
    """Measures the rate de/dt (k,) of the feature error that the target's own motion causes, as the
    difference (e_k - e_{k-1}) / dt - L v of the errors in successive pictures, where v is the
    camera twist measured over the same interval.

    With the last command in place of the measured twist, which is one frame off, the loop diverges.
    """

    def __init__(self, features: FeatureSet) -> None:
        self._features = features
        self.forget()
        self.value = np.zeros(len(features.names))

    def measure(self, error: Array, own: Array, dt: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return the rate de/dt (k,) [1/s] of the feature error that the target's own motion caused
        since the previous call, and True (k,) for each feature that was measured both now and then.
        For the other features the rate keeps its last value, at first zero. Call it for each
        picture in which the target is seen.

        Args:
            error: Feature error (k,), divided by the features' scales; nan for features that were
                not measured.
            own: The part of de/dt (k,) that the camera's own motion caused, L v [1/s].
            dt: Time since the previous picture [s].
        """
        fresh = np.isfinite(error) & np.isfinite(self._last)
        now, last = (np.where(fresh, e, 0.0) for e in (error, self._last))
        self.value = np.where(fresh, self._features.error(now, last) / dt - own, self.value)
        self._last = error
        return self.value, fresh

    def forget(self) -> None:
        """Discard the stored error, so that the next rate needs two more pictures. Call it after a
        frame in which the target is not seen.
        """
        self._last = np.full(len(self._features.names), np.nan)
