"""Estimator of a target at rest: it estimates no motion, so that the law follows a moving target
with a lag.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.estimators._unfiltered import Unfiltered


@dataclass(frozen=True, slots=True)
class Config:
    """The estimator `none` has no settings."""

    def build(self, rng: np.random.Generator) -> "Nothing":
        """Return the estimator, which uses no random numbers."""
        return Nothing()


@final
class Nothing(Unfiltered):
    """Estimator that returns the measured feature error (0 for features that were not measured),
    and zero for the rate of the error that the target's own motion causes.
    """
