"""The skeleton of all particle filters on one model of the target: search, estimate, resample."""

from collections.abc import Callable
from typing import final

import numpy as np

from sim.types import Array, Frame
from tracking.appearance.bins import Labelled
from tracking.appearance.model import SampledModel
from tracking.lock import Lock
from tracking.recognition import Recogniser
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import CloudSettings
from tracking.types import Estimate, Region, State, Status, check_region

Search = Callable[[ParticleFilter, SampledModel, Labelled, Array, float], int]
"""How the particles of one frame find the target: moves and weighs them, and returns how many
histograms were read. It is given the particles, the target's appearance, the picture, the expected
change (4,) since the last frame, and a factor on all noise."""


@final
class CloudTracker:
    """A particle filter; `search` is what differs between the methods."""

    def __init__(self, config: CloudSettings, search: Search, rng: np.random.Generator) -> None:
        self._config = config
        self._search = search
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram and put all particles on the target."""
        check_region(frame, region, state)
        c = self._config
        self._model = c.model(c.view(frame.image), region, state)
        noise = (c.noise, c.turn_noise, c.scale_noise)
        self._cloud = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._velocity = Velocity(state, c.velocity_memory)
        self._lock = Lock(c.lock)
        self._status = Status.LOCKED
        self._found = state
        self._recogniser = None
        if c.views > 0:
            self._recogniser = Recogniser(c, c.view(frame.image), region, state, self._model)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Search, estimate, resample."""
        c = self._config
        cloud = self._cloud
        lost = self._status is Status.LOST
        image = self._model.label(c.view(frame.image))
        widen = c.widen_when_lost if lost else 1.0
        strewn = lost and c.scatter > 0
        if strewn:
            height, width = frame.image.shape[:2]
            cloud.scatter(c.scatter, (width, height), self._found)
        if lost and self._recogniser is not None:
            self._recogniser.send(cloud, image, self._found)
        evaluations = self._search(cloud, self._model, image, self._velocity.step(ego), widen)
        searched = lost and self._recogniser is not None  # in many places: their mean is none
        state = cloud.best() if c.estimate == "best" or searched else cloud.mean()
        if self._recogniser is None:
            distance = float(self._model.distances(image, state.vector[None])[0])
        else:
            distance = self._recogniser.doubt(image, state, cloud, frame.time)
        self._status = self._lock.judge(
            distance, frame.time, self._velocity.jump(state, cloud.size)
        )
        found = cloud.estimate(state, distance, self._status, evaluations + 1)
        seen = self._status is Status.LOCKED
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
