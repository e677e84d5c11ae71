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
from tracking.loops import descent as loops
from tracking.types import Region, State

TINY = 1e-12
"""Least normaliser of a histogram: a kernel without pixels gets an empty one instead of nan."""
PIXELS = 2000
"""Most pixels that are read: of larger targets only every second, third, ... one."""
TOLERANCE = 0.2
"""A step with all coordinates below this ends the descent [px, or as much in angle and scale]. It
is taken without an evaluation: so near the minimum Newton's steps are right, and an evaluation
would cost a third of the search."""
UNITS = np.array([1.0, 1.0, 1 / 20, 1 / 20])
"""Steps of x, y [px], of the angle [rad] and of ln scale that move a common target's rim alike."""


HELD = 1e-9
"""Unit of an angle that is not searched: the damping keeps it where it is."""
USUAL = 0.025
"""Distance d_m that noise and parallax leave at the right place; chosen by hand on shipped targets
(tests/benchmarks/nees.py)."""
ANYWHERE = np.array([12**-0.5, 12**-0.5, np.pi / 3**0.5, 1.0])
"""Standard deviations where the picture shows nothing: of x and y evenly over the target's size, of
the angle evenly over all, of ln scale about threefold."""


@dataclass(frozen=True, slots=True)
class Descent:
    """End of a descent: the last state, the distance from the reference histograms there or just
    before, and the number of states evaluated.
    """

    state: State
    distance: float
    """Bhattacharyya distance d_m, 0..1, at the last evaluated state that was accepted: `state`, or
    the one before it if the last step was not evaluated; the objective is O = 2 d_m^2."""
    evaluations: int
    """Number of states whose histograms were computed."""


@dataclass(frozen=True, slots=True)
class KernelGrid:
    """Settings of a grid of `per_side` x `per_side` Epanechnikov kernels over the template: their
    half axes in cells of the grid (`span`), the number of colour bins of each channel (`levels`),
    and the share of the template's width and height that is left out at its rim (`inset`).
    """

    per_side: int = 3
    """Kernels along each side of the template; 3 makes the nine of Teuliere, Marchand, Eck."""
    span: float = 1.0
    """Half axis of a kernel in cells of the grid: larger widens the basin, smaller sharpens the
    angle."""
    levels: int = 8
    """Colour bins a channel."""
    inset: float = 0.0
    """Share of the region's width and height that is left out, half on each side."""


TURNS = np.radians(np.arange(15, 360, 15))
"""Turns of the template in the first picture [rad]."""
SHIFTED = 0.25
"""Length of the shifts with which the turns are compared, over the target's size."""
INNER = KernelGrid(inset=0.3)
"""Kernels over the middle of the template: its corners around a round target show the ground,
which does not turn with the target."""
LEAST_TURN = 0.3
"""A target shows no angle if a turn changes its distance by less than this share of what a shift
changes. Discs and cylinders from above have at most 0.09, a plain rectangle of sides 1.2 to 1 has
0.16, a plain ellipse of 1.5 to 1 0.34, shipped targets at least 0.77."""


class KernelModel:
    """The target's reference histograms under a grid of Epanechnikov kernels, computed from the
    first picture, RGB (H, W, 3); and a search, by damped Newton steps, for a state in another
    picture with similar histograms. If `turns` is False the angle is not searched.
    """

    def __init__(
        self,
        image: Image,
        region: Region,
        state: State,
        grid: KernelGrid,
        *,
        turns: bool = True,
    ) -> None:
        """Compute the target's reference histograms from the first picture.

        Args:
            image: First picture, RGB (H, W, 3).
            region: The target's rectangle [px].
            state: State of the target in that picture.
            grid: The kernels.
            turns: True: `descend` searches the angle, too; False: the angle stays as it was.
        """
        # Levenberg's damping acts on steps in these units: a tiny unit holds the angle.
        self._units = UNITS if turns else UNITS * (1, 1, HELD, 1)
        size = sqrt(region.area(state))
        anywhere = ANYWHERE * (size, size, 1, 1)
        self._prior = np.diag(anywhere**-2)
        """Information (4, 4) on the state that bounds its variance."""
        searched = self._units > HELD
        self._searched = np.outer(searched, searched)
        """True (4, 4) for the covariances that a search can tell."""
        inside = region.inner(grid.inset)
        # One kernel in the middle of each cell of the grid (section III: nine kernels).
        offsets = (np.arange(grid.per_side) + 0.5) / grid.per_side - 0.5
        u, v = np.meshgrid(offsets * inside.width, offsets * inside.height)
        centres = np.stack([u.ravel(), v.ravel()], axis=1)
        cell = grid.span * inside.width / grid.per_side, grid.span * inside.height / grid.per_side
        half = (inside.width / 2, inside.height / 2)
        self.kernels: loops.Kernels = half, centres, cell, grid.levels, PIXELS
        """The kernels, as the compiled loops take them."""
        stride = loops.stride_for(state.vector, self.kernels)
        sums, totals = loops.histograms(image, state.vector, self.kernels, stride)
        self.root_reference = np.sqrt(sums[:, :, 0] / np.maximum(totals[:, :1], TINY) + loops.FLOOR)
        """Square roots of the reference histograms (K, B)."""

    def descend(
        self,
        image: Image,
        state: State,
        *,
        most: int,
        tolerance: float = TOLERANCE,
        hopeless: float = 1.0,
    ) -> Descent:
        """Descend from a state to a local minimum of the Bhattacharyya distance d_m, 0..1, between
        the histograms in a picture and the reference histograms.

        Args:
            image: RGB (H, W, 3).
            state: State from which the descent begins.
            most: Largest number of states whose histograms are computed.
            tolerance: A step with all coordinates below this ends the descent [px, or 1/20 rad, or
                1/20 of ln scale]; it is taken, but its end is not evaluated.
            hopeless: Distance d_m, 0..1; a first state with a larger distance is returned
                unchanged.

        Returns:
            The last state, the distance of the last evaluated state that was accepted, and the
            number of states evaluated.
        """
        x, cost, evaluations = loops.descend(
            image,
            state.vector,
            self.kernels,
            self.root_reference,
            self._units,
            most,
            tolerance,
            2 * hopeless**2,
        )
        # O = 2 d_m^2 is at most 2, but for rounding.
        return Descent(State.of(x), sqrt(min(cost / 2, 1.0)), evaluations)

    def covariance(self, image: Image, state: State) -> Array:
        """Return the covariance (4, 4) of x, y [px], theta [rad] and ln scale at the end of a
        descent: one standard deviation away, the squared distance d_m^2 of the histograms is larger
        by 0.025^2.

        It is large, but bounded, along directions in which the histograms hardly change; rows and
        columns of an angle that is not searched are nan. The histogram computed here is not counted
        as evaluation.

        Args:
            image: RGB (H, W, 3).
            state: State at which the descent ended.
        """
        # O grows by dx' H dx, and H / (2 USUAL^2) is the information. The prior bounds
        # the variance along which O is flat.
        x = state.vector
        stride = loops.stride_for(x, self.kernels)
        _, _, curvature = loops.linearise(image, x, self.kernels, self.root_reference, stride)
        found = np.linalg.inv(curvature / (2 * USUAL**2) + self._prior)
        return np.where(self._searched, found, np.nan)


def changes(image: Image, region: Region, state: State) -> tuple[float, float]:
    """Return how much the target's histograms change when the template is shifted, and when it is
    turned, in the first picture. Only the middle 70 % of the template's width and height is used.

    Returns:
        The Bhattacharyya distance, 0..1, from the unchanged histograms after a shift by a quarter
        of the target's size (root of its area), as a mean over eight directions; and the largest
        distance after a turn, of turns by 15, 30, ... 345 deg.
    """
    model = KernelModel(image, region, state, INNER)
    stride = loops.stride_for(state.vector, model.kernels)
    shift = SHIFTED * np.sqrt(region.area(state))
    around = np.arange(8) * np.pi / 4
    none = np.zeros(8)
    shifts = np.column_stack([shift * np.cos(around), shift * np.sin(around), none, none])

    def distance(change: Array) -> float:
        x = state.vector + change
        cost, _, _ = loops.linearise(image, x, model.kernels, model.root_reference, stride)
        return sqrt(cost / 2)

    turned = max(distance(np.array([0.0, 0.0, turn, 0.0])) for turn in TURNS)
    return float(np.mean([distance(change) for change in shifts])), turned


def shows_angle(image: Image, region: Region, state: State) -> bool:
    """Return True if turning the template in the first picture changes the target's histograms at
    least 0.3 times as much as shifting it by a quarter of the target's size does; also if neither
    changes them.

    If the result is False, as for a disc or a mug from above, an estimated angle would drift, and
    the camera would turn with it.
    """
    shifted, turned = changes(image, region, state)
    return turned >= LEAST_TURN * shifted
