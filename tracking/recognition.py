"""Recognition of the target by views: one confidence of several cheap signs, and places to search
when it is LOST.

The signs are the distance of colours, the likeness to stored views, and the spread of the
particles. Their sum is smoothed over time, because a target is seldom lost for one frame.
"""

import math

import numpy as np

from sim.types import Array, Image
from tracking.appearance.bins import LabelledImage
from tracking.appearance.model import SampledModel
from tracking.appearance.views import Views
from tracking.loss import LossLimits
from tracking.search.particles import ParticleFilter
from tracking.types import Region, State

# The weights of a logistic regression on seven of 13 annotated recordings, rounded by hand. The
# other constants were chosen on all of them, in about twenty tries (tracking/RESULTS.md).
BIAS = -7.0
BY_DISTANCE = -5.0
BY_LIKENESS = 13.0
BY_SPREAD = -15.0
MOST_SIGN = 4.0
"""Largest size of a sum of signs: one frame must not outweigh those around it."""
MEMORY = 0.15
"""Time over which the confidence is smoothed [s]."""
TRUSTED = 0.8
"""At this confidence the present view is learned."""
CANDIDATES = 5
"""Number of places most like a view, to which particles are sent while the target is LOST."""
SENT = 0.25
"""Share of the particles that are sent there."""
LIMITS = LossLimits(floor=0.8, cap=0.8, hysteresis=0.75, patience=0.4)
"""Limits of 1 - the confidence."""
TINY = 1e-12
"""Keeps the spread of particles finite whose weights are all zero."""


class Recogniser:
    """The views of one target, and the confidence that it is what the tracker follows."""

    def __init__(
        self, count: int, image: Image, region: Region, state: State, model: SampledModel
    ) -> None:
        """Take the first view, and let the model compare states with it.

        Args:
            count: Number of views that are kept.
            image: First picture as the model sees it (H, W, 3).
            region: The template.
            state: State of the target there.
            model: Model of the target's appearance.
        """
        self._views = Views(image, region, state, count)
        self._model = model
        self._logit = 0.0
        self._time = -math.inf
        self._sign = 0.0
        model.recognise(self._views)

    def doubt(
        self, image: LabelledImage, state: State, cloud: ParticleFilter, time: float
    ) -> float:
        """Return 1 - the confidence at a state, and remember it."""
        at = state.vector[None]
        distance = float(self._model.distances(image, at)[0])
        likeness = float(self._views.likeness(image.blurred, at)[0])
        logit = BIAS + BY_DISTANCE * distance + BY_LIKENESS * likeness
        logit = float(np.clip(logit + BY_SPREAD * _spread(cloud, state), -MOST_SIGN, MOST_SIGN))
        self._sign = logit
        keep = math.exp(-max(time - self._time, 0.0) / MEMORY)
        self._logit = keep * self._logit + (1 - keep) * logit
        self._time = time
        return 1 / (1 + math.exp(self._logit))

    def learn(self, image: LabelledImage, state: State, doubt: float) -> None:
        """Take the view at a state where there is hardly a doubt.

        The smoothed doubt lags: by it alone, what hides the target would become a view of it. So
        this frame itself must speak for the target as well.
        """
        if doubt <= 1 - TRUSTED and self._sign > 0:
            self._views.learn(image.blurred, state)

    def send(self, cloud: ParticleFilter, image: LabelledImage, last: State) -> None:
        """Send the last particles to the places that are most like a view."""
        places: Array = self._views.search(image.blurred, last, CANDIDATES)
        count = round(SENT * len(cloud.samples))
        if len(places) and count:
            cloud.samples[-count:] = places[np.arange(count) % len(places)]


def _spread(cloud: ParticleFilter, state: State) -> float:
    """Return the root mean square distance from a state of the particles nearer than the target's
    size, over that size; those farther away follow something else.
    """
    away = np.hypot(*(cloud.samples[:, :2] - [state.x, state.y]).T) / (cloud.size * state.scale)
    weights = np.where(away < 1.0, cloud.weights, 0.0)
    return float(np.sqrt(np.sum(weights * away**2) / max(np.sum(weights), TINY)))
