"""Modes of a controller while the target is not seen: first COASTING, then HOLDING, then
SEARCHING.
"""

from typing import final

import numpy as np

from servo.types import Mode
from sim.types import Array

PITCH = 0.12
"""Distance between the turns of the search spiral [m]: the view at the goal's depth covers it
twice."""
REACH = 0.6
"""Distance from the start at which the search ends [m]; the camera then holds for good."""


@final
class TargetLoss:
    """Chooses the mode of a controller (coast, hold, search) by the time for which the target has
    not been seen, and makes the search spiral.
    """

    def __init__(self, coast: float, hold: float | None, speed: float) -> None:
        """Create it for a target that is seen.

        Args:
            coast: Time without the target for which the camera follows the predicted motion [s].
            hold: Time for which the camera then stands before it searches [s]; None: it never
                searches.
            speed: Speed of the camera while it searches [m/s].
        """
        self._coast = coast
        self._hold = hold
        self._speed = speed
        self._unseen = self._turned = 0.0

    def seen(self) -> Mode:
        """Record that the target is seen, and return `Mode.SERVOING`."""
        self._unseen = self._turned = 0.0
        return Mode.SERVOING

    def wait(self, dt: float) -> Mode:
        """Record that the target was not seen for another dt [s], and return the mode: COASTING,
        HOLDING or SEARCHING. Beyond 0.6 m from its start the search ends, and the mode is HOLDING.
        """
        self._unseen += dt
        if self._unseen <= self._coast:
            return Mode.COASTING
        out = PITCH * self._turned / (2 * np.pi) > REACH
        if self._hold is None or self._unseen <= self._coast + self._hold or out:
            return Mode.HOLDING
        return Mode.SEARCHING

    def search(self, dt: float) -> Array:
        """Go on with the search for another dt [s], and return the camera twist (6,) [m/s] of this
        time: constant speed along an Archimedean spiral in the camera's x-y plane, whose turns are
        0.12 m apart.
        """
        b = PITCH / (2 * np.pi)
        phi = self._turned
        # Tangent of the spiral, d(r cos phi, r sin phi) / d phi.
        along = b * np.array([np.cos(phi) - phi * np.sin(phi), np.sin(phi) + phi * np.cos(phi)])
        length = float(np.linalg.norm(along))
        self._turned += self._speed * dt / length
        return np.concatenate([self._speed * along / length, np.zeros(4)])
