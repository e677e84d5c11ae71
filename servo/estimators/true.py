"""Estimator that returns the true motion of the target, for comparison only: an ideal feed-forward
that no camera can measure. Only a simulation provides it (`true_motion` of `Loop.start`).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.estimators._unfiltered import Unfiltered
from sim.channels import Channel, View


@dataclass(frozen=True, slots=True)
class Config:
    """The estimator `true` has no settings."""

    needs = frozenset({Channel.TRUE_MOTION})

    def build(self, rng: np.random.Generator) -> "Ideal":
        """Return the estimator, which uses no random numbers."""
        return Ideal()


@final
class Ideal(Unfiltered):
    """Estimator that returns the feature error as it was measured, and the true rate at which the
    target's own motion changes it. The simulation gives this rate by `see`; before the first call
    it is zero.
    """

    def see(self, view: View) -> None:
        """Store the target's true motion for the next prediction; keep the last one if it is None.

        Args:
            view: Data of the picture; `view.true_motion` is the mean rate (k,) at which the
                target's own motion changes the features while the next command acts, over the
                features' scales [1/s].
        """
        if view.true_motion is not None:
            self.motion = view.true_motion
