"""Condensation: a particle filter on one colour histogram (Isard and Blake 1998; Perez et al.
2002).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from sim.types import Array, Frame
from tracking.lock import Lock
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import PLAIN, CloudSettings
from tracking.types import Estimate, Region, State, Status, check_region

FILTER: dict[str, Any] = PLAIN | {
    "noise": 1.0,
    "gamma": 20.0,
    "velocity_memory": 0.0,
    "scale_noise": 0.0,
}
"""The first paper's particle filters with constant velocity. It does not give the noise: this is
half the largest motion per frame of its wildest sequences, for all filters alike. Its weights 1 - d
(`likelihood`) lose the target in every filter; these are the usual exp(-20 d^2).
"""
SAME = {"particles": 40}
"""The first paper compares its filters with the same number of particles."""
PRESETS = {"paper": FILTER | SAME}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Particles and histogram."""

    def build(self, rng: np.random.Generator) -> Condensation:
        """The tracker; its samples are drawn from the generator."""
        return Condensation(self, rng)


@final
class Condensation:
    """Select, predict, measure."""

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        self._config, self._rng = config, rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram and put all particles on the target."""
        check_region(frame, region, state)
        c = self._config
        self._model = c.model(frame.image, region, state)
        noise = (c.noise, c.turn_noise, c.scale_noise)
        self._cloud = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._velocity = Velocity(state, c.velocity_memory)
        self._lock, self._status = Lock(c.lock), Status.LOCKED

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Predict, weigh, estimate, resample."""
        c, image = self._config, self._model.label(frame.image)
        widen = c.widen_when_lost if self._status is Status.LOST else 1.0
        self._cloud.predict(self._velocity.step(ego), widen)
        self._cloud.weigh(c.log_likelihood(self._model.energy(image, self._cloud.samples)))
        state = self._cloud.best() if c.estimate == "best" else self._cloud.mean()
        distance = float(self._model.distances(image, state.vector[None])[0])
        self._status = self._lock.judge(distance, frame.time)
        found = self._cloud.estimate(state, distance, self._status, c.particles + 1)
        self._velocity.learn(state, seen=self._status is Status.LOCKED)
        self._cloud.resample()
        if self._status is Status.LOCKED:
            self._model.learn(image, state)
        return found
