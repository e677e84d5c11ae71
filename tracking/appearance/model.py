"""Distance of any state from the target's reference histograms, at fixed template points under one
kernel or several.

With the template cut into cells this is the multiple-kernel representation of the particle filter
(Teuliere, Marchand, Eck, sections II and IV-B); with one Epanechnikov disc it is that of mean shift
(Comaniciu, Ramesh, Meer 2003) and of the single-kernel filters. Equations (1)
to (5) of the paper, as we reconstruct them:

    f_x(l)  = R(-theta) (l - (x, y)) / s                       the image in template coordinates
    q_u(x)  = C sum_i K(f_x(l_i) - c) delta[b(l_i) - u]        histogram, sums to 1
    rho(x)  = sum_u sqrt(q*_u q_u(x))                          Bhattacharyya coefficient
    d_m(x)  = sqrt(1 - mean_j rho_j(x))                        over the parts j

The distance is the mean over the nine parts, not the sum: the sum is the same likelihood with nine
times gamma, under which 300 particles leave an effective sample of two.
"""

from dataclasses import dataclass

import numpy as np

from sim.types import Array, Image
from tracking.appearance.bins import Bins, ColourBins, LabelledImage, as_seen
from tracking.appearance.layout import Sampling, ring
from tracking.appearance.reference import Reference
from tracking.appearance.views import Views
from tracking.loops import point_histograms as loops
from tracking.settings import Contrast, Inset, Levels
from tracking.types import Region, State, Trait

FINER = 4
"""Factor on the number of the reference's points along each side, so that it does not depend on the
pixel grid."""
RING = 0.4
"""Width of the ring around the target that is compared with it, both sides together, over its size:
the nine cells' bias of size is then smallest (a prototype on painted scenes)."""
UNLIKE = 0.3
"""Weight of 1 - likeness to the views beside the squared distance of colours; chosen by hand on 13
annotated recordings (tracking/RESULTS.md)."""


@dataclass(frozen=True)
class AppearanceSettings:
    """Settings of the histograms that describe a target: colour bins of each channel (`levels`),
    correction of uneven light (`even`), share of the region's sides that is left out at its rim
    (`inset`), weight of the surroundings' similarity to the target (`contrast`), and whether bins
    count by how well they separate the target from its surroundings, and both are learnt from later
    pictures, too (`learn`).
    """

    traits = frozenset({Trait.COLOUR})

    levels: Levels = 8
    """Colour bins a channel; the KAMS paper has 10."""
    even: bool = False
    """Divide each pixel by its largest channel, as if all pixels were lit alike: the histograms
    then bear changes of light, but distinguish bright things from dark ones less well.
    """
    inset: Inset = 0.0
    """Share of the region's width and height that is left out, half on each side: there the
    background shows, whose change would be taken for the target's."""
    contrast: Contrast = 0.25
    """Weight eta of the surrounding ring's likeness to the target: keeps the box from shrinking."""
    learn: bool = True
    """Weigh bins by how well they separate the target from its surroundings, and follow slow
    changes of both in the pictures where the target was found."""

    @property
    def sampling(self) -> Sampling:
        """Settings of the points at which the target is read; by default those of one ellipse under
        Epanechnikov's kernel.
        """
        return Sampling()

    def bins(self, image: Image, region: Region, state: State) -> Bins:
        """Return the division of pixels into histogram bins: by default into equal intervals of
        each colour channel.

        Args:
            image: First picture, RGB (H, W, 3), as `as_seen` returns it.
            region: The target's rectangle [px].
            state: State of the target in that picture.
        """
        return ColourBins(self.levels)

    def model(self, image: Image, region: Region, state: State) -> "SampledModel":
        """Return the reference histograms of the target, learnt from the first picture, RGB
        (H, W, 3). There the target is the rectangle `region` [px], placed by `state` (x, y [px],
        theta [rad], scale).

        Raises:
            ValueError: `image` is not a picture.
        """
        return SampledModel(image, region, state, self)


class SampledModel:
    """The target's reference histograms, learnt from the first picture, in which it is the
    rectangle `region` [px] at `state`; and the distance of any state from them.

    `distances` compares histograms only. `energy` is the squared distance plus the setting
    `contrast` times the similarity between the target and the ring around the region, which keeps
    the region from shrinking into the target, where the histogram stays the same; after `recognise`
    it also compares stored views.
    """

    def __init__(
        self, image: Image, region: Region, state: State, settings: AppearanceSettings
    ) -> None:
        """Learn the target from the first picture.

        Args:
            image: First picture, RGB (H, W, 3).
            region: The target's rectangle [px].
            state: State of the target in that picture.
            settings: Settings of the histograms.
        """
        inside = region.inner(settings.inset)
        sampling = settings.sampling
        seen = as_seen(image, even=settings.even)
        self._settings = settings
        self._bins = settings.bins(seen, region, state)
        self._layout = sampling.layout(inside)
        self._ring = ring(region, RING, sampling.density * (sampling.cells or 1))
        self._factor = self._layout.count if sampling.combine == "sum" else 1
        self._radius = max(self._layout.radius, self._ring.radius)
        self._views: Views | None = None
        # Read on a finer grid than states are: else the reference prefers its own pixel phase.
        labelled = LabelledImage(seen, self._bins)
        fine = sampling.layout(inside, FINER)
        self._reference = Reference(labelled, region, state, fine, learns=settings.learn)

    def label(self, image: Image) -> LabelledImage:
        """Return a picture, RGB (H, W, 3), with the bin numbers of its pixels, as `distances`,
        `energy`, `climb` and `learn` take it.

        Raises:
            ValueError: The array is not an RGB picture of uint8.
        """
        seen = as_seen(image, even=self._settings.even)
        blurred = seen if self._views is None else self._views.blurred(seen)
        return LabelledImage(seen, self._bins, self._reference.radius, blurred)

    def recognise(self, views: Views) -> None:
        """Compare states with stored views (small pictures of the target) from now on: `energy`
        then adds 0.3 (1 - c), where c, -1..1, is the largest correlation of the picture at a state
        with a view.
        """
        self._views = views

    def distances(self, image: LabelledImage, states: Array) -> Array:
        """Return the distances (N,), from 0 (alike) to 1, of states (N, 4), x, y [px], theta [rad],
        ln scale, from the reference: sqrt(1 - rho), where rho is the mean Bhattacharyya coefficient
        of the histograms of the template's cells.
        """
        rho = self._coefficients(self._window(image, states), states)
        return np.sqrt(loops.squared_distances(rho))

    def energy(self, image: LabelledImage, states: Array) -> Array:
        """Return the energy (N,) of states (N, 4): x, y [px], theta [rad], ln scale. A particle
        filter weighs a state by exp(-gamma energy).

        The energy is the square of the distance (`distances`), plus the setting `contrast` times
        the Bhattacharyya coefficient of the ring around the target with the target. After
        `recognise`, 0.3 (1 - c) is added, with the largest correlation c of the picture at the
        state with a stored view. With `sampling.combine = "sum"` all is multiplied by the number of
        the template's cells.
        """
        window = self._window(image, states)
        squared = loops.squared_distances(self._coefficients(window, states))
        if self._views is not None:
            squared = squared + UNLIKE * (1 - self._views.likeness(image.blurred, states))
        if self._settings.contrast == 0:
            return self._factor * squared
        ring = (self._ring.points, self._ring.parts, self._ring.weights)
        likeness = loops.coefficients(window, states, *ring, self._reference.root_whole)[:, 0]
        return self._factor * (squared + self._settings.contrast * likeness)

    def climb(
        self, image: LabelledImage, states: Array, *, most: int, tolerance: float, reach: float
    ) -> tuple[Array, Array, int]:
        """Move x and y of each state to a local maximum of the similarity to the reference
        histogram (Bhattacharyya coefficient) by mean shift; angle and scale stay. The template must
        have one part (no cells).

        Args:
            image: The picture.
            states: First states (N, 4): x, y [px], theta [rad], ln scale.
            most: Largest number of histograms that are computed for a state.
            tolerance: A mean-shift step that is not longer than this ends a search [px].
            reach: Distance around the template at the first states up to which pixels are read
                [px].

        Returns:
            The states (N, 4) at the maxima, their distances (N,) from the reference, 0..1, and the
            number of histograms computed for all states together.
        """
        window = self._window(image, states, reach)
        at = (self._layout.points, self._layout.weights, self._layout.pulls)
        found, rho, evaluations = loops.mean_shift(
            window, states, *at, self._reference.root_parts, most, tolerance
        )
        return found, np.sqrt(loops.squared_distances(rho[:, None])), evaluations

    def learn(self, image: LabelledImage, state: State) -> None:
        """Move the reference histograms, and that of the surroundings by which their bins are
        weighed, towards those at a state where the target was found; do nothing unless the setting
        `learn` is true.
        """
        self._reference.learn(image, state)

    def _coefficients(self, window: loops.Window, states: Array) -> Array:
        at = (self._layout.points, self._layout.parts, self._layout.weights)
        return loops.coefficients(window, states, *at, self._reference.root_parts)

    def _window(self, image: LabelledImage, states: Array, reach: float = 0.0) -> loops.Window:
        return image.around(states, self._radius, reach)
