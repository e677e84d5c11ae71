"""A gate on the size of a target: it cannot change faster than a followed target comes and goes.

The size s of a rigid target at depth Z is in proportion to 1 / Z, so d ln s / dt = -Z' / Z, whose
inverse is the time to contact (Lee, A theory of visual control of braking based on information
about time-to-collision, Perception 5, 1976). A box that slips into a corner of a plain solid
shrinks faster, and neither its histograms nor their curvature show that it is wrong.
"""

import math
from collections import deque
from typing import final

from tracking.types import State

MOST_RATE = 4 / 3
"""Largest rate of ln scale [1/s]: contact in 0.75 s. Sizes change by at most 0.34 in the shipped
scenarios, camera and target together, and seldom by more than 1 in annotated recordings; boxes that
slip shrink by about 1.8."""
SPAN = 0.3
"""Shortest time over which the rate is taken [s]: noise of the size between two pictures is no
motion."""


@final
class SizeGate:
    """Judges whether a target can have a size, by the sizes and times at which it was seen."""

    def __init__(self, state: State, time: float) -> None:
        """Record the size of the target's state in the first picture, at a time [s]."""
        self._seen = deque([(time, math.log(state.scale))])

    def allows(self, state: State, time: float) -> bool:
        """Return whether the target can have a state's size at a time [s]: whether ln scale has
        changed by `MOST_RATE` at most since the target was seen `SPAN` or longer ago.
        """
        while len(self._seen) > 1 and self._seen[1][0] <= time - SPAN:
            self._seen.popleft()
        then, size = self._seen[0]
        # Time without the target counts: after a long absence it may have any size.
        return abs(math.log(state.scale) - size) <= MOST_RATE * max(time - then, SPAN)

    def learn(self, state: State, time: float) -> None:
        """Record the size of a target that was seen in a state at a time [s]."""
        self._seen.append((time, math.log(state.scale)))
