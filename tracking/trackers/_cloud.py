"""Base of all particle filters on one model of the target's appearance: predict, climb, weigh,
estimate, resample.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from sim.types import Array, Frame
from tracking.appearance.bins import LabelledImage
from tracking.appearance.model import AppearanceSettings
from tracking.loss import LossJudge, LossLimits
from tracking.recognition import LIMITS, Recogniser
from tracking.search.annealing import ONE_LAYER, Annealing, anneal
from tracking.search.newton import shows_angle
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import ParticleSettings
from tracking.types import SET_BY_START, Estimate, Region, State, Status, check_region

DISC_LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of a distance of sampled histograms: of hard bins, it is never near 0."""
WIDER = 3.0
"""Factor on the particles' noise while a target without views is LOST: it may be anywhere."""
CLIMB = 6
"""Most histograms that mean shift reads for a particle in a layer."""
CLIMB_TOLERANCE = 0.5
"""Mean shift ends for a particle with a step shorter than this [px]."""


@dataclass(frozen=True, slots=True)
class CloudMethod:
    """Choices in which the particle filters differ: number of annealing layers, climbing by mean
    shift, the reported state, and the weights used while the target is not seen.
    """

    annealing: Annealing = ONE_LAYER
    """Number of layers in which the particles are weighed, and schedule of their exponents."""
    climbs: bool = False
    """Let every particle climb by mean shift before it is weighed."""
    best: bool = False
    """Report the particle with the largest weight, not the weighted mean."""
    hidden: float = 1.0
    """Exponent of the weights in resampling while the target is not seen."""


@dataclass(frozen=True)
class CloudSettings(AppearanceSettings, ParticleSettings):
    """Settings of a particle filter on histograms; each tracker changes defaults and `method`."""

    @property
    def method(self) -> CloudMethod:
        """Choices in which this filter differs from others: by default those of Condensation."""
        return CloudMethod()

    def build(self, rng: np.random.Generator) -> "ParticleTracker":
        """Return the tracker; its samples are drawn from the generator."""
        return CloudTracker(self, DISC_LIMITS, rng)


class ParticleTracker(ABC):
    """Base class of particle filters on one appearance model: subclasses move, weigh and judge the
    particles.
    """

    _cloud: ParticleFilter = SET_BY_START

    def __init__(
        self, settings: CloudSettings, limits: LossLimits, rng: np.random.Generator
    ) -> None:
        """Store settings, limits and generator; `start` makes the particles.

        Args:
            settings: Settings of the filter and its model.
            limits: Limits of the appearance distance, used where the target is not recognised by
                stored views.
            rng: Generator of all random numbers.
        """
        self._settings = settings
        self._limits = limits
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histograms and put all particles on its state.

        Raises:
            ValueError: A side of the region is shorter than 4 px, or most of it is outside the
                picture.
        """
        check_region(frame, region, state)
        c = self._settings
        self._model = c.model(frame.image, region, state)
        image = self._model.label(frame.image).image
        # A target that looks the same at all angles says nothing about theta: it then stays fixed.
        turns = c.turn_noise > 0 and shows_angle(image, region, state)
        noise = (c.noise, c.turn_noise if turns else 0.0, c.scale_noise)
        self._cloud = ParticleFilter(region, state, c.particles, noise, self._rng)
        self._velocity = Velocity(state, c.velocity_memory)
        # With views the judged distance is 1 - confidence, else that of the histograms.
        self._loss = LossJudge(LIMITS if c.views > 0 else self._limits)
        self._status = Status.LOCKED
        self._found = state
        self._recogniser = None
        if c.views > 0:
            self._recogniser = Recogniser(c.views, image, region, state, self._model)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate of one step of the filter: predict, weigh, estimate, resample.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale that the camera's own motion
                makes; None if it is unknown.
        """
        cloud = self._cloud
        lost = self._status is Status.LOST
        strewn = lost and self._settings.scatter > 0
        image = self._model.label(frame.image)
        widen = WIDER if lost and self._recogniser is None else 1.0
        evaluations = self._search(image, self._velocity.step(ego), widen)
        # After a search by views the particles lie in several places, and their mean in none.
        searched = lost and self._recogniser is not None
        proposed = cloud.best() if self._settings.method.best or searched else cloud.mean()
        state, covariance, distance, more = self._judge(image, proposed, frame.time)
        # Before resampling, which adds only noise to the estimate (Isard, Blake 1998).
        estimate = cloud.estimate(state, covariance, distance, self._status, evaluations + more)
        seen = self._status is Status.LOCKED
        # States of strewn particles carry no information on the target's motion; while the target
        # is hidden the velocity stays, and the mean moves by it and by chance.
        self._velocity.learn(state, seen=seen and not strewn)
        cloud.resample(1.0 if seen else self._settings.method.hidden)
        if seen:
            if strewn:
                # Most strewn particles are far away: they restart at the target.
                cloud.samples[:] = state.vector
            else:
                # A refined state moves the whole cloud with it; without refinement this is zero.
                cloud.samples += state.vector - proposed.vector
            self._found = state
            self._model.learn(image, state)
            if self._recogniser is not None:
                self._recogniser.learn(image, state, distance)
        return estimate

    def _strew(self, image: LabelledImage) -> None:
        """While the target is LOST, redraw a share of the particles uniformly over the picture
        (sensor resetting), and move some to the places most like a stored view.
        """
        if self._status is Status.LOST:
            height, width = image.image.shape[:2]
            self._cloud.scatter(self._settings.scatter, (width, height), self._found)
            if self._recogniser is not None:
                self._recogniser.send(self._cloud, image, self._found)

    @abstractmethod
    def _search(self, image: LabelledImage, change: Array, widen: float) -> int:
        """Move and weigh all particles, also those redrawn over the picture.

        Args:
            image: The picture.
            change: Expected change (4,) of x, y [px], theta [rad], ln scale since the last frame.
            widen: Factor on the standard deviations of the noise.

        Returns:
            The number of histograms read.
        """

    @abstractmethod
    def _judge(
        self, image: LabelledImage, proposed: State, time: float
    ) -> tuple[State, Array, float, int]:
        """Set the status of this frame, and return the state to report.

        Args:
            image: The picture.
            proposed: State that the particles propose.
            time: Time of the frame [s].

        Returns:
            The state to report, its covariance (4, 4) of x, y [px], theta [rad] and ln scale, its
            distance 0..1, and the number of histograms read.
        """


@final
class CloudTracker(ParticleTracker):
    """A particle filter that reports the mean or the best particle, in one layer or annealed."""

    def _search(self, image: LabelledImage, change: Array, widen: float) -> int:
        self._strew(image)
        model = self._model
        method = self._settings.method
        evaluations = 0

        def log_likelihood(cloud: ParticleFilter) -> Array:
            nonlocal evaluations
            if method.climbs:
                # KAMS and the hybrid weigh a particle at the mode to which it climbs.
                cloud.samples, _, climbed = model.climb(
                    image, cloud.samples, most=CLIMB, tolerance=CLIMB_TOLERANCE, reach=cloud.size
                )
                evaluations += climbed
            evaluations += len(cloud.samples)
            # ln of the likelihood exp(-gamma d^2) of Perez et al. 2002.
            return -self._settings.gamma * model.energy(image, cloud.samples)

        anneal(self._cloud, change, log_likelihood, method.annealing, widen)
        return evaluations

    def _judge(
        self, image: LabelledImage, proposed: State, time: float
    ) -> tuple[State, Array, float, int]:
        if self._recogniser is None:
            distance = float(self._model.distances(image, proposed.vector[None])[0])
        else:
            distance = self._recogniser.doubt(image, proposed, self._cloud, time)
        self._status = self._loss.judge(distance, time)
        return proposed, self._cloud.covariance(), distance, 1
