"""Reference histograms of the target, learned from the first picture and, if asked, later ones.

Learning is beyond the papers. It weighs each bin of the reference by the share of the target among
target and surroundings, q_u / (q_u + b_u): what the background also shows counts less (the ratio of
Vojir, Noskova, Matas 2013, not the neutral weights of Comaniciu, which cancel from the mean-shift
step). It also lets the reference follow the target's appearance, but only in pictures where it was
found, and its first appearance always keeps a weight of 0.7 (Nummiaro, Koller-Meier, Van Gool
2003).
"""

import numpy as np

from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.appearance.layout import TINY, Layout, histograms, ring
from tracking.types import Region, State

# Rates as published trackers have them: 0.04 in Staple and CSRT, 0.05 in DAT. The share of the
# first appearance and the rate of the background were chosen by hand on recordings.
TARGET_RATE = 0.05
"""Weight of the present picture in the target's appearance, where the target was found."""
SURROUNDINGS_RATE = 0.1
"""Weight of the present picture in the background's appearance, where the target was found."""
ANCHOR = 0.7
"""Weight of the first appearance in a reference that follows the target."""
SURROUNDINGS = 1.0
"""Width of the surrounding background, both sides together, over the target's size."""
SURROUNDINGS_DENSITY = 32
"""Points along each side of the background."""
RARE = 1e-4
"""Mass of a bin [share of a histogram] below which it carries no information."""


class Reference:
    """Reference histograms of the target, each with the sum 1, as their square roots: `root_parts`
    (K, B) for the K parts of the template and B bins, and `root_whole` (1, B) for the whole target.
    With `learns`, a bin counts less the more the surroundings show it, and `learn` updates the
    histograms.
    """

    root_parts: Array
    """Square roots of the parts' histograms (K, B)."""
    root_whole: Array
    """Square root of the mean of the parts' histograms (1, B)."""

    def __init__(
        self, image: LabelledImage, region: Region, state: State, layout: Layout, *, learns: bool
    ) -> None:
        """Compute the histograms of the target and of its surroundings from the first picture.

        Args:
            image: First picture.
            region: The target's rectangle [px].
            state: State of the target in that picture.
            layout: Points at which the target is read.
            learns: Weigh bins by the surroundings, and follow later pictures.
        """
        self._learns = learns
        self._layout = layout
        self._around = ring(region, SURROUNDINGS, SURROUNDINGS_DENSITY)
        self._first = histograms(image, layout, state)
        self._now = self._first
        self._background = histograms(image, self._around, state)[0]
        self._combine()

    @property
    def radius(self) -> float:
        """Distance from the target's centre, at scale 1 [px], up to which the reference histograms
        need pixels.
        """
        return self._around.radius if self._learns else self._layout.radius

    def learn(self, image: LabelledImage, state: State) -> None:
        """Update the reference histograms from a picture in which the target was found at `state`:
        its later appearance, which has a weight of 0.3 beside the first one, moves towards the
        picture by a share of 0.05, the surroundings' histogram by 0.1. Do nothing if `learns` of
        the constructor was False.
        """
        if self._learns:
            self._now = _blend(self._now, histograms(image, self._layout, state), TARGET_RATE)
            around = histograms(image, self._around, state)[0]
            self._background = _blend(self._background, around, SURROUNDINGS_RATE)
            self._combine()

    def _combine(self) -> None:
        # The first appearance stays in the blend, so that errors of learning cannot accumulate.
        parts = _blend(self._now, self._first, ANCHOR)
        if self._learns:
            whole = parts.mean(axis=0)
            # Bins that the background shows, too, count less: q_u / (q_u + b_u).
            parts = parts * (whole + RARE) / (whole + self._background + 2 * RARE)
            parts = parts / np.maximum(parts.sum(axis=1, keepdims=True), TINY)
        self.root_parts = np.sqrt(parts)
        self.root_whole = np.sqrt(parts.mean(axis=0, keepdims=True))


def _blend(old: Array, new: Array, share: float) -> Array:
    return (1 - share) * old + share * new
