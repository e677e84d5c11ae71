"""Change of the feature error that the camera's own motion does not explain (Teuliere, Marchand,
Eck, equation 18).
"""

from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.parts import FeatureSet
from sim.types import Array


@final
class Difference:
    """Measures de/dt of the target's own motion by differences: (e_k - e_{k-1}) / dt - L v, where v
    is the camera twist measured over the same interval.

    With the last command in place of the measured twist, which is one frame off, the loop diverges.
    """

    def __init__(self, features: FeatureSet) -> None:
        self._features = features
        self.forget()
        self.value = np.zeros(len(features.names))

    def measure(self, error: Array, own: Array, dt: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return de/dt (k,) of the target's own motion after a picture, and True (k,) for each
        feature that was measured in this picture and in that of the previous call; de/dt of the
        other features keeps its last value, at first zero.

        Args:
            error: Feature error (k,); nan for features that were not measured.
            own: de/dt (k,) caused by the camera's own motion, L v [1/s].
            dt: Time since the last picture [s].
        """
        fresh = np.isfinite(error) & np.isfinite(self._last)
        now, last = (np.where(fresh, e, 0.0) for e in (error, self._last))
        self.value = np.where(fresh, self._features.error(now, last) / dt - own, self.value)
        self._last = error
        return self.value, fresh

    def forget(self) -> None:
        """Forget the last error, so that the next difference needs two pictures. To be called after
        a frame in which the target is not seen.
        """
        self._last = np.full(len(self._features.names), np.nan)
