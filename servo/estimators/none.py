"""No estimate: the law assumes a target at rest, and follows a moving one with a lag."""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.estimators._unfiltered import Unfiltered


@dataclass(frozen=True, slots=True)
class Config:
    """This estimator has no settings."""

    def build(self, rng: np.random.Generator) -> "Nothing":
        """Return the estimator, which uses no random numbers."""
        return Nothing()


@final
class Nothing(Unfiltered):
    """Predicts a target at rest."""
