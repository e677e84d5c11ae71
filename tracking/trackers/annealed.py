"""Annealed particle filter on one colour histogram (Deutscher, Blake, Reid 2000)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Frame
from tracking.appearance.bins import Labelled
from tracking.lock import Lock
from tracking.search.annealing import Annealing, Schedule, anneal
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import CloudSettings
from tracking.trackers import condensation
from tracking.types import Estimate, Region, State, Status, check_region

CLIMB_TOLERANCE = 0.5
"""A particle whose shift is shorter has arrived [px]."""


LAYERS: dict[str, Any] = condensation.FILTER | {
    "velocity_memory": 1.0,
    "schedule": "fixed",
    "layers": 5,
}
"""The first paper's annealing: no motion model; M = 4, so five layers."""
PRESETS = {"paper": LAYERS | condensation.SAME}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Particles, histogram, and layers."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 100
    """Number of particles."""
    noise: Annotated[float, Ge(0), Le(10)] = 0.3
    """Spread of position in the first layer, over the target's size."""
    velocity_memory: Annotated[float, Ge(0), Le(1)] = 1.0
    """Share of the old velocity that the new one keeps; 1: a random walk without velocity."""
    scale_noise: Annotated[float, Ge(0), Le(1)] = 0.015
    """Spread of ln scale per frame; 0: the tracker keeps its size."""
    layers: Annotated[int, Ge(1), Le(50)] = 5
    """Number of annealing layers."""
    schedule: Schedule = Schedule.SURVIVAL
    """"survival": exponents by the survival rate; "fixed": a geometric series."""
    survival: Annotated[float, Ge(0.001), Le(0.999)] = 0.5
    """Share of the particles that survives a layer."""
    ratio: Annotated[float, Ge(1), Le(100)] = 2.0
    """Fixed schedule: each exponent over the one of the layer before."""
    cooling: Annotated[float, Ge(0.001), Le(1)] = 0.5
    """Noise of a layer over the layer before."""
    climb: Annotated[int, Ge(0), Le(100)] = 0
    """Mean-shift histograms for each particle in each layer; 0: none (that is `kams`)."""

    def build(self, rng: np.random.Generator) -> Annealed:
        """The tracker; its samples are drawn from the generator."""
        return Annealed(self, rng)


@final
class Annealed:
    """Layers of diffusion, measurement and selection, each sharper than the one before."""

    def __init__(self, config: Config, rng: np.random.Generator) -> None:
        self._config, self._rng = config, rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram and put all particles on the target."""
        check_region(frame, region, state)
        c = self._config
        self._model = c.model(frame.image, region, state)
        self._reach = float(np.sqrt(region.area(state)))
        noise = (c.noise, c.turn_noise, c.scale_noise)
        self._cloud = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._velocity = Velocity(state, c.velocity_memory)
        self._lock, self._status = Lock(c.lock), Status.LOCKED

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Anneal, estimate, resample."""
        c, image = self._config, self._model.label(frame.image)
        self._evaluations = 0

        def likelihood(cloud: ParticleFilter) -> Array:
            if c.climb > 0:
                self._climb(image, cloud)
            self._evaluations += len(cloud.samples)
            return c.log_likelihood(self._model.energy(image, cloud.samples))

        widen = c.widen_when_lost if self._status is Status.LOST else 1.0
        layers = Annealing(c.layers, Schedule(c.schedule), c.survival, c.ratio, c.cooling)
        anneal(self._cloud, self._velocity.step(ego), likelihood, layers, widen)
        state = self._cloud.best() if c.estimate == "best" else self._cloud.mean()
        distance = float(self._model.distances(image, state.vector[None])[0])
        self._status = self._lock.judge(distance, frame.time)
        found = self._cloud.estimate(state, distance, self._status, self._evaluations + 1)
        self._velocity.learn(state, seen=self._status is Status.LOCKED)
        self._cloud.resample()
        if self._status is Status.LOCKED:
            self._model.learn(image, state)
        return found

    def _climb(self, image: Labelled, cloud: ParticleFilter) -> None:
        """Move all particles to the nearest modes."""
        cloud.samples, _, evaluations = self._model.climb(
            image,
            cloud.samples,
            most=self._config.climb,
            tolerance=CLIMB_TOLERANCE,
            reach=self._reach,
        )
        self._evaluations += evaluations
