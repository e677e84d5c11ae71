"""Base of all particle filters on one model of the target's appearance: predict, climb, weigh,
estimate, resample.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from sim.types import Array, Frame
from tracking.appearance.bins import LabelledImage
from tracking.appearance.model import AppearanceSettings
from tracking.appearance.witness import Witness
from tracking.loss import LossJudge, LossLimits
from tracking.recognition import LIMITS, Recogniser
from tracking.search.annealing import ONE_LAYER, Annealing, Schedule, anneal
from tracking.search.newton import shows_angle
from tracking.search.particles import ParticleFilter
from tracking.search.velocity import Velocity
from tracking.settings import ParticleSettings
from tracking.types import SET_BY_START, Estimate, Region, State, Status, check_region
from tracking.verdict import Signs, Verdict

DISC_LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of the distance of sampled histograms, which is never near 0: each pixel counts in one bin
alone."""
WIDER = 3.0
"""Factor on the particles' noise while the target is LOST, without views and witness: it may be
anywhere."""
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

    @property
    def idle(self) -> Mapping[str, str]:
        """The reason why `gamma` has no effect, where the layers are annealed by survival."""
        is_cancelled = self.method.annealing.schedule == Schedule.SURVIVAL
        why = 'with tracker.schedule = "survival" the exponents of the layers cancel it'
        return {"gamma": why} if is_cancelled else {}

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
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
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
        self._witness = Witness(image, region, state) if c.witness else None
        self._verdict = Verdict()
        self._last = state
        self._recogniser = None
        if c.views > 0 and self._witness is None:
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
        strewn = lost and self._settings.scatter > 0 and self._witness is None
        image = self._model.label(frame.image)
        change = self._velocity.step(ego)
        if self._witness is not None:
            self._witness.look(image.image, self._last.moved(change))
        widen = WIDER if lost and self._recogniser is None and self._witness is None else 1.0
        evaluations = self._search(image, change, widen)
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
            if self._witness is None or self._verdict.trusted:
                self._model.learn(image, state)
            if self._recogniser is not None:
                self._recogniser.learn(image, state, distance)
        self._last = state
        if self._witness is not None:
            if self._verdict.trusted:
                self._witness.learn(state)
            if not seen:
                # Nothing shows the size of a target that is not seen: it would drift.
                cloud.samples[:, 3] = self._found.vector[3]
        return estimate

    def _energy(self, image: LabelledImage, states: Array) -> Array:
        """Return the energy (N,) of states (N, 4), x, y [px], theta [rad], ln scale, by the colours
        and, if there is one, the witness: a particle is weighed by exp(-gamma energy).
        """
        energy = self._model.energy(image, states)
        return energy if self._witness is None else energy + self._witness.energy(states)

    def _hear(
        self, witness: Witness, image: LabelledImage, proposed: State, time: float
    ) -> tuple[State, float, int]:
        """Return the state to report, and set the status by how sure colours and witness are of it.
        It is the proposed state. If the target has not been LOCKED for 0.5 s, the places of the
        whole picture that are most similar to the target are judged, too, and the estimate jumps
        to the best one that convinces.

        Args:
            witness: The witness beside the colours.
            image: The picture.
            proposed: State that the particles propose.
            time: Time of the frame [s].

        Returns:
            The state, 1 - the confidence, and the number of histograms read.
        """
        verdict = self._verdict
        state = proposed
        own = best = self._signs(witness, image, proposed)
        places: list[State] = []
        if verdict.searches(time):
            places = witness.places(image.image, self._found)
            for place in places:
                # The templates' place is coarse: the filter knows it better.
                witness.look(image.image, place)
                peak = witness.peak()
                signs = self._signs(witness, image, peak)
                better = verdict.logit(signs) > verdict.logit(best)
                if better and verdict.convinces(signs, own):
                    best = signs
                    state = peak
            witness.look(image.image, state)
            # The target's motion of half a second ago says nothing, and a jump is no motion.
            self._velocity = Velocity(state, self._settings.velocity_memory)
        witness.fare(state)
        confidence = verdict.judge(best, time, anew=state is not proposed)
        self._status = verdict.status
        return state, 1 - confidence, 1 + len(places)

    def _signs(self, witness: Witness, image: LabelledImage, state: State) -> Signs:
        """Return measures of how much the picture at a state looks like the target, by the witness
        and by the colours.
        """
        distance = float(self._model.distances(image, state.vector[None])[0])
        return Signs(*witness.signs(state), distance)

    def _strew(self, image: LabelledImage) -> None:
        """While the target is LOST, redraw a share of the particles uniformly over the picture
        (sensor resetting) and, with `views`, move some to the places most like a stored view. With
        `witness`, do nothing.
        """
        if self._status is Status.LOST and self._witness is None:
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
            return -self._settings.gamma * self._energy(image, cloud.samples)

        anneal(self._cloud, change, log_likelihood, method.annealing, widen)
        return evaluations

    def _judge(
        self, image: LabelledImage, proposed: State, time: float
    ) -> tuple[State, Array, float, int]:
        if self._witness is not None:
            state, distance, evaluations = self._hear(self._witness, image, proposed, time)
            return state, self._cloud.covariance(), distance, evaluations
        if self._recogniser is None:
            distance = float(self._model.distances(image, proposed.vector[None])[0])
        else:
            distance = self._recogniser.doubt(image, proposed, self._cloud, time)
        self._status = self._loss.judge(distance, time)
        return proposed, self._cloud.covariance(), distance, 1
