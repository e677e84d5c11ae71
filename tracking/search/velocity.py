"""Constant velocity: how the target moved from frame to frame, remembered.

Where the camera's own part of it is given (ego), only the rest is remembered.
"""

import numpy as np

from sim.types import Array
from tracking.types import State


class Velocity:
    """An exponential mean of the state's change per frame."""

    def __init__(self, state: State, memory: float) -> None:
        """Begin at rest.

        Args:
            state: State of the target.
            memory: Share of the old velocity that the new one keeps; 1: always at rest.
        """
        self._last = state.vector
        self._memory = memory
        self.value = np.zeros(4)

    def step(self, ego: Array | None) -> Array:
        """Return the expected change (4,) until the next frame, with the camera's part if it is
        given.
        """
        if ego is None:
            return self.value
        self._last = self._last + ego
        return self.value + ego

    def jump(self, state: State, size: float) -> float:
        """Return the distance of a state from what `step` expected: position over the target's
        size, or ln scale, whichever is larger. The size [px] is that at scale 1.
        """
        x, y, _, scale = state.vector - (self._last + self.value)
        return float(max(np.hypot(x, y) / (size * state.scale), abs(scale)))

    def learn(self, state: State, *, seen: bool) -> None:
        """Take the next state; the velocity of a target that is not seen stays."""
        if seen:
            moved: Array = state.vector - self._last
            self.value = self._memory * self.value + (1 - self._memory) * moved
        self._last = state.vector
