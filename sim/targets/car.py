"""Target: a blue toy car of 0.20 x 0.10 m with dark windows and a white stripe on its bonnet."""

import functools
from dataclasses import dataclass
from importlib import resources

import mujoco
import numpy as np

from sim.models.target import Target, target_of


@dataclass(frozen=True, slots=True)
class Config:
    """The toy car has no settings."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: the model of the car, with the reference rectangle that stands for it
        in control. `rng` is not used; every call returns the same object.
        """
        return _car()


@functools.cache  # it is the same in all runs of a study
def _car() -> Target:
    return target_of(mujoco.MjSpec.from_file(str(resources.files("scenes") / "car.xml")))
