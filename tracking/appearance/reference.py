"""A target's appearance, learned from the first picture and, if asked, from later ones.

Two things beyond the papers, both optional. `discriminate` weighs each bin of the reference by the
share of the target among target and surroundings, q_u / (q_u + b_u): what the background also shows
counts less (the ratio of Vojir, Noskova, Matas 2013, not the neutral weights of Comaniciu, which
cancel from the mean-shift step). `update` lets the reference follow the target's appearance, but
only in pictures where it was found, and never farther than `ANCHOR` from its first appearance
(Nummiaro, Koller-Meier, Van Gool 2003).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array
from tracking.appearance.bins import Labelled
from tracking.appearance.layout import Layout, histograms, ring
from tracking.types import Region, State

ANCHOR = 0.7
"""Share of the first appearance in a reference that is updated."""
SURROUNDINGS = 1.0
"""Width of the background that counts, both sides together, over the target's size."""
SURROUNDINGS_DENSITY = 32
SURROUNDINGS_RATE = 0.1
"""Share of the background that is new in each picture."""
RARE = 1e-4
"""A bin with less mass than this carries no information."""
TINY = 1e-12


@dataclass(frozen=True, slots=True)
class Learning:
    """What the reference takes from the target's surroundings and from later pictures."""

    contrast: Annotated[float, Ge(0), Le(100)] = 0.0
    """Weight eta of the surrounding ring's likeness to the target: keeps the box from shrinking."""
    ring: Annotated[float, Ge(0.25), Le(4)] = 0.4
    """Width of that ring, both sides together, over the target's size."""
    discriminate: bool = False
    """Weigh the reference's bins by how well they separate the target from its surroundings."""
    update: Share = 0.0
    """Share of the target's appearance that is new in each picture where it was found; 0: the first
    picture decides."""


class Reference:
    """The reference histograms of all parts, and of the whole."""

    root_parts: Array
    """Square roots of the histograms (K, B)."""
    root_whole: Array
    """Square root of their mean (1, B)."""

    def __init__(
        self,
        image: Labelled,
        region: Region,
        state: State,
        layout: Layout,
        learning: Learning,
    ) -> None:
        """Learn from the first picture.

        Args:
            image: First frame.
            region: The template.
            state: Where the target is.
            layout: Where the target is read.
            learning: What else is learned.
        """
        self.learning = learning
        self._layout = layout
        self._around = ring(region, SURROUNDINGS, SURROUNDINGS_DENSITY)
        self._first = self._now = histograms(image, layout, state)
        self._background = histograms(image, self._around, state)[0]
        self._combine()

    @property
    def radius(self) -> float:
        """How far around the target a picture is read for learning, at scale 1 [px]."""
        return self._around.radius if self.learning.discriminate else self._layout.radius

    def learn(self, image: Labelled, state: State) -> None:
        """Take over the appearance at a state where the target was found."""
        if self.learning.update > 0:
            self._now = _blend(
                self._now, histograms(image, self._layout, state), self.learning.update
            )
        if self.learning.discriminate:
            seen = histograms(image, self._around, state)[0]
            self._background = _blend(self._background, seen, SURROUNDINGS_RATE)
        if self.learning.update > 0 or self.learning.discriminate:
            self._combine()

    def _combine(self) -> None:
        parts = _blend(self._now, self._first, ANCHOR)
        if self.learning.discriminate:
            whole = parts.mean(axis=0)
            parts = parts * (whole + RARE) / (whole + self._background + 2 * RARE)
            parts = parts / np.maximum(parts.sum(axis=1, keepdims=True), TINY)
        self.root_parts = np.sqrt(parts)
        self.root_whole = np.sqrt(parts.mean(axis=0, keepdims=True))


def _blend(old: Array, new: Array, share: float) -> Array:
    return (1 - share) * old + share * new
