"""A tracker from outside the packages, as a user may write one."""

from dataclasses import dataclass

import numpy as np

from tracking.trackers import frozen


@dataclass(frozen=True)
class MyConfig:
    """A tracker that stands still."""

    gain: float = 1.0

    def build(self, rng: np.random.Generator):
        return frozen.Config().build(rng)
