"""Multiple-kernel SSD tracking by Newton steps (Hager, Dewan, Stewart 2004; Teuliere, Marchand,
Eck, section III, equations 6 to 9).

The objective O(x) = mean_j ||sqrt(q_j(x)) - sqrt(q*_j)||^2 = 2 - 2 rho(x) has the minima of d_m.
With e = sqrt(q) - sqrt(q*) and J_U = diag(q)^(-1/2) dq/dx, a step minimises ||e + J_U dx / 2||^2,
so dx = -2 J_U^+ e. Four things the paper leaves out matter:

* The normaliser C of the histogram depends on the state: with S = sum_m k_m,
  dK_i/dp = (dk_i/dp - K_i sum_m dk_m/dp) / S. Without the second term the scale column of the
  Jacobian is wrong by about its own size.
* Kernels see only pixels of the object (the template), else the background makes the scale biased.
* A pixel on the template's rim counts by how much of it is covered, and the derivative knows it.
  With a hard rim O has a false minimum wherever a pixel's centre crosses the rim: descents from
  0 to 16 px away then end anywhere within half a pixel, after 9 to 20 evaluations instead of 5.
* Plain Gauss-Newton oscillates: Levenberg damping, and a step counts only if it lowers O.

Colours are binned softly (tetrahedrally) here, which makes O smooth in the state.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from sim.types import Array, Image
from tracking.hot import descent as hot
from tracking.types import Region, State

ANGLE_UNIT = 1 / 20
SCALE_UNIT = 1 / 20
"""Angle [rad] and ln scale that count as much as one pixel."""
TINY = 1e-12
UNITS = np.array([1.0, 1.0, ANGLE_UNIT, SCALE_UNIT])


@dataclass(frozen=True, slots=True)
class Refined:
    """Where the search ended."""

    state: State
    distance: float
    """The distance d_m there."""
    evaluations: int
    """How often the histograms were computed."""


def distance_of(cost: float) -> float:
    """The Bhattacharyya distance: O = 2 d_m^2 (equation 6)."""
    return sqrt(min(cost / 2, 1.0))


class KernelModel:
    """The target under a grid of Epanechnikov kernels, and the search for it."""

    def __init__(
        self,
        image: Image,
        region: Region,
        state: State,
        *,
        per_side: int = 3,
        span: float = 1.0,
        levels: int = 8,
        pixels: int = 2000,
        inset: float = 0.0,
    ) -> None:
        """Learn the reference histograms.

        Args:
            image: First frame (H, W, 3).
            region: The template.
            state: Where it is.
            per_side: Kernels along each side of the grid.
            span: Half axis of a kernel in cells of the grid: larger widens the basin, smaller
                sharpens the angle.
            levels: Bins a channel.
            pixels: Larger targets are read at every second, third, ... pixel to stay below this.
            inset: Share of the region's width and height that is left out, half on each side.
        """
        region = region.inner(inset)
        offsets = (np.arange(per_side) + 0.5) / per_side - 0.5
        u, v = np.meshgrid(offsets * region.width, offsets * region.height)
        centres = np.stack([u.ravel(), v.ravel()], axis=1)
        axes = (span * region.width / per_side, span * region.height / per_side)
        half = (region.width / 2, region.height / 2)
        self._kernels: hot.Kernels = half, centres, axes, levels, pixels
        sums, totals = self.histograms(image, state.vector)
        self._root_reference = np.sqrt(sums[:, :, 0] / np.maximum(totals[:, :1], TINY) + hot.FLOOR)

    def histograms(self, image: Image, x: Array) -> tuple[Array, Array]:
        """Histograms under the kernels at x (4,), not normalised: as of `hot.kernel_histograms`."""
        return hot.histograms(image, x, self._kernels)

    def linearise(self, image: Image, x: Array) -> tuple[float, Array, Array]:
        """The objective at x (4,), half its gradient (4,) and half its curvature (4, 4), as of
        Gauss and Newton.
        """
        return hot.linearise(image, x, self._kernels, self._root_reference)

    def refine(
        self,
        image: Image,
        state: State,
        *,
        most: int = 8,
        tolerance: float = 0.2,
        hopeless: float = 1.0,
    ) -> Refined:
        """Descend from a state to the nearest minimum of the objective.

        Args:
            image: RGB (H, W, 3).
            state: Where to begin.
            most: Largest number of evaluations.
            tolerance: A step shorter than this is the last, and not tried before it is taken
                [px, or as much in angle and scale]: so near the minimum Newton's steps are right,
                and to try this one would cost a third of the search.
            hopeless: A start with a larger distance than this is returned as it is.
        """
        x, cost, evaluations = hot.descend(
            image,
            state.vector,
            self._kernels,
            self._root_reference,
            UNITS,
            most,
            tolerance,
            2 * hopeless**2,
        )
        return Refined(State.of(x), distance_of(cost), evaluations)
