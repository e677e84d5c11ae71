"""Constant-velocity prediction: an exponential mean of the target's motion from frame to frame.

Where the part of that motion which the camera causes (`ego`) is known, the mean is of the remaining
motion.
"""

import numpy as np

from sim.types import Array
from tracking.types import State


class Velocity:
    """Exponential mean `value` (4,) of the target's change of x, y [px], theta [rad] and ln scale
    per frame, without the part that the camera's motion causes where that is known. It is 0 at
    first; `memory`, 0..1, is the weight of the old mean.
    """

    def __init__(self, state: State, memory: float) -> None:
        """Begin at a state with the velocity 0.

        Args:
            state: First state of the target.
            memory: Weight of the old velocity in the new one, 0..1; with 1 the velocity stays 0.
        """
        self._last = state.vector
        self._memory = memory
        self.value = np.zeros(4)

    def step(self, ego: Array | None) -> Array:
        """Return the expected change (4,) of x, y [px], theta [rad] and ln scale until the next
        frame. Call it once a frame, before `jump` and `learn`, because they compare with its
        prediction.

        Args:
            ego: Part of that change (4,) that the camera's motion causes; None: not known.
        """
        if ego is None:
            return self.value
        # `learn` compares with the last state: moving it by the camera's part leaves the target's.
        self._last = self._last + ego
        return self.value + ego

    def jump(self, state: State, size: float) -> float:
        """Return how far a state is from the one that `step` predicted: the distance of the
        positions over the target's size, or the difference of ln scale, whichever is larger. The
        angle does not count.

        Args:
            state: The state that was found.
            size: Size of the target at scale 1 [px].
        """
        x, y, _, scale = state.vector - (self._last + self.value)
        return float(max(np.hypot(x, y) / (size * state.scale), abs(scale)))

    def learn(self, state: State, *, seen: bool) -> None:
        """Update the velocity by the change from the state of the last call, moved by the camera's
        part that `step` was given, to `state`. If the target was not seen, keep the velocity, but
        store `state` for the next call.

        Args:
            state: State that was found in the current frame.
            seen: True if the target was seen there.
        """
        # A state that was not confirmed would teach the velocity the tracker's own drift.
        if seen:
            moved: Array = state.vector - self._last
            self.value = self._memory * self.value + (1 - self._memory) * moved
        self._last = state.vector
