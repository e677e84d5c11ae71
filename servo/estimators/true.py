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
    """Estimator that returns the measured error, and the true motion of the target that the
    simulation gave last, at first zero.
    """

    def see(self, view: View) -> None:
        """Store `view.true_motion`: the target's true mean de/dt (k,) while the next command acts,
        divided by the features' scales [1/s].
        """
        if view.true_motion is not None:
            self.motion = view.true_motion
