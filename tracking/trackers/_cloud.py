"""The skeleton of all particle filters on one model of the target: predict, climb, weigh, estimate,
resample.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from sim.types import Array, Frame, Image
from tracking.appearance.bins import LabelledImage
from tracking.appearance.model import SampledModel
from tracking.lock import Lock, LockLimits
from tracking.recognition import LOCK, Recogniser
from tracking.search.annealing import ONE_LAYER, Annealing, anneal
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import ParticleSettings
from tracking.types import Estimate, Region, State, Status, check_region

DISC_LOCK = LockLimits(floor=0.5, cap=0.75)
"""Limits of a distance of sampled histograms: of hard bins, it is never near 0."""
WIDER = 3.0
"""Factor on the spread while a target without views is LOST: it may be anywhere."""
CLIMB = 6
"""Mean-shift histograms for each particle that climbs, in each layer."""
CLIMB_TOLERANCE = 0.5
"""A particle whose shift is shorter has arrived [px]."""

ModelMaker = Callable[[Image, Region, State], SampledModel]
"""Makes the model of a target from the first picture."""


@dataclass(frozen=True, slots=True)
class CloudMethod:
    """Parts in which the particle filters differ."""

    model: ModelMaker
    annealing: Annealing = ONE_LAYER
    """Layers in which the particles are weighed."""
    climbs: bool = False
    """Let every particle climb by mean shift before it is weighed."""
    best: bool = False
    """Take the best particle for the target's state, not their mean."""


@final
class CloudTracker:
    """A particle filter on one model of the target."""

    def __init__(
        self, settings: ParticleSettings, method: CloudMethod, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._method = method
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target and put all particles on it."""
        check_region(frame, region, state)
        c = self._settings
        self._model = self._method.model(frame.image, region, state)
        noise = (c.noise, c.turn_noise, c.scale_noise)
        self._cloud = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._velocity = Velocity(state, c.velocity_memory)
        self._lock = Lock(LOCK if c.views > 0 else DISC_LOCK)
        self._status = Status.LOCKED
        self._found = state
        self._recogniser = None
        if c.views > 0:
            image = self._model.label(frame.image).image
            self._recogniser = Recogniser(c.views, image, region, state, self._model)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Search, estimate, resample."""
        c = self._settings
        cloud = self._cloud
        lost = self._status is Status.LOST
        image = self._model.label(frame.image)
        widen = WIDER if lost and self._recogniser is None else 1.0
        strewn = lost and c.scatter > 0
        if strewn:
            height, width = frame.image.shape[:2]
            cloud.scatter(c.scatter, (width, height), self._found)
        if lost and self._recogniser is not None:
            self._recogniser.send(cloud, image, self._found)
        evaluations = self._search(image, self._velocity.step(ego), widen)
        searched = lost and self._recogniser is not None  # in many places: their mean is none
        state = cloud.best() if self._method.best or searched else cloud.mean()
        if self._recogniser is None:
            distance = float(self._model.distances(image, state.vector[None])[0])
        else:
            distance = self._recogniser.doubt(image, state, cloud, frame.time)
        self._status = self._lock.judge(distance, frame.time)
        found = cloud.estimate(state, distance, self._status, evaluations + 1)
        seen = self._status is Status.LOCKED
        # States of strewn particles carry no information on the target's motion.
        self._velocity.learn(state, seen=seen and not strewn)
        cloud.resample()
        if seen:
            self._found = state
            self._model.learn(image, state)
            if self._recogniser is not None:
                self._recogniser.learn(image, state, distance)
        if seen and strewn:
            cloud.gather(state)
        return found

    def _search(self, image: LabelledImage, change: Array, widen: float) -> int:
        """Move and weigh the particles.

        Args:
            image: The picture.
            change: Expected change (4,) of the state since the last frame.
            widen: Factor on all noise.

        Returns:
            The number of histograms read.
        """
        model = self._model
        evaluations = 0

        def log_likelihood(cloud: ParticleFilter) -> Array:
            nonlocal evaluations
            if self._method.climbs:
                cloud.samples, _, climbed = model.climb(
                    image, cloud.samples, most=CLIMB, tolerance=CLIMB_TOLERANCE, reach=cloud.size
                )
                evaluations += climbed
            evaluations += len(cloud.samples)
            return -self._settings.gamma * model.energy(image, cloud.samples)

        anneal(self._cloud, change, log_likelihood, self._method.annealing, widen)
        return evaluations
