"""The true motion of the target, for comparison only: an ideal feed-forward that no camera can
measure. The simulation provides it (`true_motion` of `Loop.start`).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.channels import Channel, View
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """This estimator has no settings."""

    needs = frozenset({Channel.TRUE_MOTION})

    def build(self, rng: np.random.Generator) -> "Ideal":
        """Return the estimator, which uses no random numbers."""
        return Ideal()


@final
class Ideal:
    """Returns the true motion that it was given last; zero before the first."""

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set."""
        self._motion = np.zeros(len(features.names))

    def see(self, view: View) -> None:
        """Store the target's true mean motion (k,) while the next command acts, over the scales."""
        if view.true_motion is not None:
            self._motion = view.true_motion

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the true motion, and the error as it was measured."""
        return Prediction.unmeasured(np.nan_to_num(error), self._motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the true motion, and an error of zero."""
        return Prediction.unmeasured(np.zeros_like(self._motion), self._motion)
