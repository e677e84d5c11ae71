"""The modes of a controller while the target is not seen: coast, hold, search."""

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
    """Chooses what a controller does (coast, hold, search) by how long the target was not seen."""

    def __init__(self, coast: float, hold: float | None, speed: float) -> None:
        """Create it with a visible target.

        Args:
            coast: Time for which the camera follows the predicted motion [s].
            hold: Time for which it then stands before it searches [s]; None: it never searches.
            speed: Speed of the search [m/s].
        """
        self._coast = coast
        self._hold = hold
        self._speed = speed
        self._unseen = self._turned = 0.0

    def seen(self) -> Mode:
        """Record that the target is visible, and return the mode."""
        self._unseen = self._turned = 0.0
        return Mode.SERVOING

    def wait(self, dt: float) -> Mode:
        """Record that the target has not been seen for another interval dt [s], and return the
        mode.
        """
        self._unseen += dt
        if self._unseen <= self._coast:
            return Mode.COASTING
        out = PITCH * self._turned / (2 * np.pi) > REACH
        if self._hold is None or self._unseen <= self._coast + self._hold or out:
            return Mode.HOLDING
        return Mode.SEARCHING

    def search(self, dt: float) -> Array:
        """Return the next camera twist (6,) [m/s], of constant speed, along a spiral r = b phi in
        the plane of the image.
        """
        b = PITCH / (2 * np.pi)
        phi = self._turned
        # Tangent of the spiral, d(r cos phi, r sin phi) / d phi.
        along = b * np.array([np.cos(phi) - phi * np.sin(phi), np.sin(phi) + phi * np.cos(phi)])
        length = float(np.linalg.norm(along))
        self._turned += self._speed * dt / length
        return np.concatenate([self._speed * along / length, np.zeros(4)])
