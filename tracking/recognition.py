"""Is it still the target? One confidence of several cheap signs, and where to look when it is not.

The signs are the distance of colours, the likeness to stored views, and the spread of the
particles. Their weights are those of a logistic regression on half of the annotated recordings
(tracking/README.md). The sum is smoothed over time, because a target is seldom lost for one frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.appearance.bins import Labelled
from tracking.appearance.model import SampledModel
from tracking.appearance.views import Views
from tracking.lock import LockConfig
from tracking.search.particles import ParticleFilter
from tracking.types import Region, State

BIAS = -7.0
BY_DISTANCE = -5.0
BY_LIKENESS = 13.0
BY_SPREAD = -15.0
CLEAR = 4.0
"""A sum of signs beyond this, either way, is no clearer."""
TINY = 1e-12
MEMORY = 0.15
"""Time over which the confidence is smoothed [s]."""
TRUSTED = 0.8
"""At this confidence the present view is learned."""
CANDIDATES = 5
"""Places that are most like a view, to which particles are sent while the target is LOST."""
SENT = 0.25
"""Share of the particles that are sent there."""
LOCK = LockConfig(floor=0.8, cap=0.8, hysteresis=0.75, patience=0.4)


@dataclass(frozen=True)
class Recognition:
    """By what the target is recognised besides its colours."""

    views: Annotated[int, Ge(0), Le(16)] = 0
    """How many small pictures of the target are kept, the first and the newest, by which it is
    recognised, judged LOST, and found again; 0: none, its colours decide."""
    unlike: Annotated[float, Ge(0), Le(100)] = 0.3
    """Weight of 1 - likeness to the views beside the squared distance of colours."""


class Recogniser:
    """The views of one target, and the confidence that it is what the tracker follows."""

    def __init__(
        self, settings: Recognition, image: Image, region: Region, state: State, model: SampledModel
    ) -> None:
        """Take the first view, and let the model compare states with it."""
        self._views = Views(image, region, state, settings.views)
        self._model = model
        self._logit = 0.0
        self._time = -math.inf
        self._sign = 0.0
        model.recognise(self._views, settings.unlike)

    def doubt(self, image: Labelled, state: State, cloud: ParticleFilter, time: float) -> float:
        """1 - the confidence at a state."""
        at = state.vector[None]
        distance = float(self._model.distances(image, at)[0])
        likeness = float(self._views.likeness(image.blurred, at)[0])
        logit = BIAS + BY_DISTANCE * distance + BY_LIKENESS * likeness
        logit = float(np.clip(logit + BY_SPREAD * _spread(cloud, state), -CLEAR, CLEAR))
        self._sign = logit
        keep = math.exp(-max(time - self._time, 0.0) / MEMORY)
        self._logit = keep * self._logit + (1 - keep) * logit
        self._time = time
        return 1 / (1 + math.exp(self._logit))

    def learn(self, image: Labelled, state: State, doubt: float) -> None:
        """Take the view at a state where there is hardly a doubt, and this frame adds none."""
        if doubt <= 1 - TRUSTED and self._sign > 0:
            self._views.learn(image.blurred, state)

    def send(self, cloud: ParticleFilter, image: Labelled, last: State) -> None:
        """Send the last particles to the places that are most like a view."""
        places: Array = self._views.search(image.blurred, last, CANDIDATES)
        count = round(SENT * len(cloud.samples))
        if len(places) and count:
            cloud.samples[-count:] = places[np.arange(count) % len(places)]


def _spread(cloud: ParticleFilter, state: State) -> float:
    """Root mean square distance from a state of the particles nearer than the target's size, over
    that size; those farther away follow something else.
    """
    away = np.hypot(*(cloud.samples[:, :2] - [state.x, state.y]).T) / (cloud.size * state.scale)
    weights = np.where(away < 1.0, cloud.weights, 0.0)
    return float(np.sqrt(np.sum(weights * away**2) / max(np.sum(weights), TINY)))
