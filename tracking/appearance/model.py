"""How far any state is from a target's reference: histograms at fixed template points, under one
kernel or many.

With the template cut into cells this is the multiple-kernel representation of the particle filter
(Teuliere, Marchand, Eck, sections II and IV-B); with one Epanechnikov disc it is that of mean shift
(Comaniciu, Ramesh, Meer 2003) and of the single-kernel filters. The paper's lost equations (1) to
(5), as we read them:

    f_x(l)  = R(-theta) (l - (x, y)) / s                       the image in template coordinates
    q_u(x)  = C sum_i K(f_x(l_i) - c) delta[b(l_i) - u]        histogram, sums to 1
    rho(x)  = sum_u sqrt(q*_u q_u(x))                          Bhattacharyya coefficient
    d_m(x)  = sqrt(1 - mean_j rho_j(x))                        over the parts j

The distance is the mean over the nine parts, not the sum: the sum is the same likelihood with nine
times gamma, under which 300 particles leave an effective sample of two.
"""

import numpy as np

from sim.types import Array, Image
from tracking.appearance.bins import Bins, Labelled
from tracking.appearance.layout import Combine, Kernel, Layout, disc, grid, ring
from tracking.appearance.reference import Learning, Reference
from tracking.appearance.views import Views
from tracking.hot import point_histograms as hot
from tracking.types import Region, State

REFERENCE_DENSITY = 4
"""The reference is read this much more densely a side, so that it does not depend on the pixel
grid.
"""


class SampledModel:
    """The target's reference histograms, and the distance of any state from them.

    `contrast` adds eta times the likeness of the surrounding ring to the whole target to the
    squared distance: a box that shrinks into the target then pays for it, which the histogram alone
    does not see.
    """

    def __init__(
        self, layout: Layout, around: Layout, bins: Bins, reference: Reference, combine: Combine
    ) -> None:
        """Put a model together.

        Args:
            layout: Where states are read.
            around: The ring, for the contrast.
            bins: What is counted.
            reference: The target's appearance.
            combine: How the energies of the parts are combined.
        """
        self._factor = layout.count if combine == "sum" else 1
        self._bins = bins
        self._layout = layout
        self._ring = around
        self._reference = reference
        self._radius = max(layout.radius, around.radius)
        self._views: Views | None = None
        self._unlike = 0.0

    def label(self, image: Image) -> Labelled:
        """A picture (H, W, 3), ready to be read by the other methods; one object a picture."""
        found = Labelled(image, self._bins, self._reference.radius)
        if self._views is not None:
            found.blurred = self._views.blurred(image)
        return found

    def recognise(self, views: Views, unlike: float) -> None:
        """From now on the energy has another term: `unlike` times 1 - the likeness to the views."""
        self._views = views
        self._unlike = unlike

    def distances(self, image: Labelled, states: Array) -> Array:
        """d_m (N,) of each state (N, 4)."""
        rho = self._coefficients(self._window(image, states), states)
        return np.sqrt(hot.squared_distances(rho))

    def energy(self, image: Labelled, states: Array) -> Array:
        """What a likelihood exp(-gamma energy) takes (N,): d_m^2 + eta * likeness of the ring, and
        of views if there are some; with summed parts, times their number.
        """
        window = self._window(image, states)
        squared = hot.squared_distances(self._coefficients(window, states))
        eta = self._reference.learning.contrast
        if self._views is not None:
            squared = squared + self._unlike * (1 - self._views.likeness(image.blurred, states))
        if eta == 0:
            return self._factor * squared
        ring = (self._ring.points, self._ring.parts, self._ring.weights)
        likeness = hot.coefficients(window, states, *ring, self._reference.root_whole)[:, 0]
        return self._factor * (squared + eta * likeness)

    def climb(
        self, image: Labelled, states: Array, *, most: int, tolerance: float, reach: float
    ) -> tuple[Array, Array, int]:
        """Mean shift from each state (N, 4): the states at the modes, their distances, the cost.

        Args:
            image: The picture.
            states: Where to begin.
            most: Largest number of histograms read for a state.
            tolerance: A shorter shift ends a search [px].
            reach: How far a search may go [px].
        """
        window = self._window(image, states, reach)
        at = (self._layout.points, self._layout.weights, self._layout.pulls)
        found, rho, evaluations = hot.mean_shift(
            window, states, *at, self._reference.root_parts, most, tolerance
        )
        return found, np.sqrt(hot.squared_distances(rho[:, None])), evaluations

    def learn(self, image: Labelled, state: State) -> None:
        """Take over the present appearance of target and surroundings, if the settings say so."""
        self._reference.learn(image, state)

    def _coefficients(self, window: hot.Window, states: Array) -> Array:
        at = (self._layout.points, self._layout.parts, self._layout.weights)
        return hot.coefficients(window, states, *at, self._reference.root_parts)

    def _window(self, image: Labelled, states: Array, reach: float = 0.0) -> hot.Window:
        return image.around(states, self._radius, reach)


def model_of(
    image: Image,
    region: Region,
    state: State,
    bins: Bins,
    learning: Learning,
    *,
    density: int,
    per_side: int | None = None,
    kernel: Kernel = "epanechnikov",
    combine: Combine = "mean",
    inset: float = 0.0,
) -> SampledModel:
    """The template with a ring around it: in per_side^2 cells, with `density` points along each
    side; or under one kernel, with so many along its diameter. Of the region's sides the share
    `inset` is left out.
    """
    inside = region.inner(inset)

    def layout(density: int) -> Layout:
        return (
            disc(inside, density, kernel) if per_side is None else grid(inside, per_side, density)
        )

    around = ring(region, learning.ring, density * (per_side or 1))
    dense = layout(REFERENCE_DENSITY * density)
    labelled = Labelled(image, bins)
    reference = Reference(labelled, region, state, dense, learning)
    return SampledModel(layout(density), around, bins, reference, combine)
