"""Recognition of the target by stored views (small pictures of it): the confidence that a state
shows the target, and places at which to search while the target is LOST.

The confidence is a logistic regression on three measures: distance of colour histograms, similarity
to the stored views, and spread of the particles. It is smoothed over time, because a target is
seldom lost for one frame only.
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
"""Constant term of the logit of the confidence."""
BY_DISTANCE = -5.0
"""Weight of the histograms' distance, 0..1."""
BY_LIKENESS = 13.0
"""Weight of the similarity to the stored views."""
BY_SPREAD = -15.0
"""Weight of the particles' spread, as a share of the target's size."""
MOST_SIGN = 4.0
"""Largest absolute logit of one frame, so that one frame does not outweigh those around it."""
MEMORY = 0.15
"""Time over which the confidence is smoothed [s]."""
TRUSTED = 0.8
"""Smallest confidence with which the current view is stored."""
CANDIDATES = 5
"""Number of places most similar to a stored view, to which particles move while the target is
LOST."""
SENT = 0.25
"""Share of the particles that move to the places most similar to a stored view."""
LIMITS = LossLimits(floor=0.8, cap=0.8, hysteresis=0.75, patience=0.4)
"""Limits of 1 - the confidence."""
TINY = 1e-12
"""Smallest sum of weights: particles whose weights are all zero have a finite spread."""


class Recogniser:
    """Computes the confidence, 0 (lost) to 1 (certain), that a tracker follows its target, from
    colours, the spread of the particles, and the likeness to at most `count` stored views (pictures
    of 8 x 8 points of the target), and sends particles to where a lost target may be. A new object
    makes `model` compare states with the views, too.
    """

    def __init__(
        self, count: int, image: Image, region: Region, state: State, model: SampledModel
    ) -> None:
        """Store the first view, and make the model compare states with all stored views.

        Args:
            count: Largest number of stored views.
            image: First picture, RGB (H, W, 3), as `as_seen` returns it; not blurred.
            region: Size of the target in the first picture [px].
            state: State of the target in the first picture.
            model: Model of the target's appearance, which is changed.
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
        """Return 1 - the confidence that a state shows the target, from 0 (certain) to 1 (lost),
        smoothed over 0.15 s. Call it once for each frame.

        Args:
            image: Current picture, as `SampledModel.label` returns it.
            state: State that is judged, usually the current estimate.
            cloud: Current particles; the farther they spread, the lower the confidence.
            time: Time of the frame [s].
        """
        at = state.vector[None]
        distance = float(self._model.distances(image, at)[0])
        likeness = float(self._views.likeness(image.blurred, at)[0])
        logit = BIAS + BY_DISTANCE * distance + BY_LIKENESS * likeness
        logit = float(np.clip(logit + BY_SPREAD * _spread(cloud, state), -MOST_SIGN, MOST_SIGN))
        self._sign = logit
        # First-order low pass for frames at any times; the first frame is taken as it is.
        keep = math.exp(-max(time - self._time, 0.0) / MEMORY)
        self._logit = keep * self._logit + (1 - keep) * logit
        self._time = time
        return 1 / (1 + math.exp(self._logit))

    def learn(self, image: LabelledImage, state: State, doubt: float) -> None:
        """Store the picture of the target at a state as a new view (8 x 8 points) if the smoothed
        confidence is at least 0.8, the confidence of this frame alone is above 0.5, and no stored
        view is alike (correlation above 0.9). If only one view may be stored, it stays
        the first one.

        Args:
            image: Current picture.
            state: State of the target in the picture.
            doubt: 1 - the smoothed confidence, as the method `doubt` returned it for this frame.
        """
        # The smoothed confidence lags: by it alone, an occluder would be stored as a view.
        if doubt <= 1 - TRUSTED and self._sign > 0:
            self._views.learn(image.blurred, state)

    def send(self, cloud: ParticleFilter, image: LabelledImage, last: State) -> None:
        """Move a quarter of the particles to the places in the picture, at most five, that are most
        similar to a stored view (a small picture of the target). If no place is found, move none.

        Args:
            cloud: The particles, of which the last ones in the array are moved.
            image: Current picture.
            last: Last state in which the target was seen: the particles get its angle, and 0.8, 1
                or 1.25 times its size.
        """
        places: Array = self._views.search(image.blurred, last, CANDIDATES)
        count = round(SENT * len(cloud.samples))
        if len(places) and count:
            cloud.samples[-count:] = places[np.arange(count) % len(places)]


def _spread(cloud: ParticleFilter, state: State) -> float:
    """Return the weighted root mean square distance of the particles from a state, as a share of
    the target's size. Particles farther away than that size follow something else and do not count;
    the result is 0 if none is nearer.
    """
    away = np.hypot(*(cloud.samples[:, :2] - [state.x, state.y]).T) / (cloud.unit * state.scale)
    weights = np.where(away < 1.0, cloud.weights, 0.0)
    return float(np.sqrt(np.sum(weights * away**2) / max(np.sum(weights), TINY)))
