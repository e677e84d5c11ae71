"""What a controller does while it does not see the target: coast, hold, search."""

from typing import final

import numpy as np

from servo.types import Mode
from sim.types import Array

PITCH = 0.12
"""Distance between the windings of the search [m]: a view of the goal's depth covers it twice."""
REACH = 0.6
"""The search ends this far from where it began [m]; then the camera holds for good."""


@final
class TargetLoss:
    """Counts how long the target has not been seen."""

    def __init__(self, coast: float, hold: float | None, speed: float) -> None:
        """Begin with the target in sight.

        Args:
            coast: How long the estimate is still followed [s].
            hold: How long the camera then stands before it searches [s]; None: it never does.
            speed: Speed of the search [m/s].
        """
        self._coast = coast
        self._hold = hold
        self._speed = speed
        self._unseen = self._turned = 0.0

    def seen(self) -> Mode:
        """Take the target for seen."""
        self._unseen = self._turned = 0.0
        return Mode.SERVOING

    def wait(self, dt: float) -> Mode:
        """Take the target for not seen for another interval [s]."""
        self._unseen += dt
        if self._unseen <= self._coast:
            return Mode.COASTING
        out = PITCH * self._turned / (2 * np.pi) > REACH
        if self._hold is None or self._unseen <= self._coast + self._hold or out:
            return Mode.HOLDING
        return Mode.SEARCHING

    def search(self, dt: float) -> Array:
        """Return the next camera twist (6,) along a spiral r = b phi, at constant speed in the
        image's plane.
        """
        b = PITCH / (2 * np.pi)
        phi = self._turned
        along = b * np.array([np.cos(phi) - phi * np.sin(phi), np.sin(phi) + phi * np.cos(phi)])
        length = float(np.linalg.norm(along))
        self._turned += self._speed * dt / length
        return np.concatenate([self._speed * along / length, np.zeros(4)])
