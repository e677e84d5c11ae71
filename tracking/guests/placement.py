"""Conversion of the reports of another author's tracker into states of the target's region."""

import math

import numpy as np

from sim.types import Array
from tracking.guests.report import Gives, Report, box_around, is_upright
from tracking.types import Region, State, goes_around

RESIZED = 1e-3
"""Smallest change of ln scale that counts as a change of size."""
SQUARE = 1e-2
"""Largest deviation of a rectangle's angles from 90 deg, as the cosine of an angle."""
SMALLEST_FACTOR = 1e-9
"""Least size of corners over the first ones, whose logarithm is still finite."""
ORDERS = [np.roll(order, k) for k in range(4) for order in ((0, 1, 2, 3), (3, 2, 1, 0))]
"""Indices of a quadrilateral's four corners, from each corner on, in both senses."""


class Placement:
    """Converts boxes and corners that a tracker of another author reports into states of the
    target's region in the first picture.

    An upright box gives the centre, and the change of scale since the first picture as the square
    root of its area over that of the upright box around the region in the first picture; the angle
    is that in the first picture. A box with an angle gives the angle too, and the change of scale
    by its area over the region's. Four corners give
    centre, angle and scale by the similarity that maps the region's first corners to them with
    least squares. Angle and scale change only if they are measured: as the tracker declares
    (`gives`; None: as its reports show); without `sizes` the scale never changes.
    """

    turns = False
    """True once an angle was reported, or corners that are not those of an upright box; always
    False if the tracker declares what it measures without "angle"."""
    resizes = False
    """True if the size is followed and measured: the tracker declares "size", or, if it declares
    nothing, the reported size has changed. Before, the scale of a state stays that of the first
    picture."""
    tilts = False
    """True once corners were reported that are not those of a rectangle."""

    def __init__(
        self,
        region: Region,
        state: State,
        gives: frozenset[Gives] | None = None,
        *,
        sizes: bool = True,
        given: Array | None = None,
    ) -> None:
        """Begin with the target in the first picture.

        Args:
            region: Size of the target in the first picture [px].
            state: State of the target in the first picture.
            gives: What the tracker declares that it measures; None: what its reports show.
            sizes: Follow the size, if it is measured.
            given: Upright box (4,) of the target that the tracker was given [px], where that is cut
                off at the picture's border; None: the whole one. Reports are compared with it.
        """
        self._gives = gives
        self._sizes = sizes
        self._log_size: float | None = None
        """Change of ln scale from the first picture to the first report; None before it."""
        self._first = state
        self._corners = region.corners(state)
        self._last = self._corners
        self._around = box_around(self._corners) if given is None else given
        self._own_area = region.area(state)
        self.state = state

    def follow(self, report: Report) -> None:
        """Set the attributes `state`, `corners`, `turns`, `resizes` and `tilts` by the report on a
        picture; a report without box and corners changes nothing.
        """
        if report.corners is not None:
            self._follow_corners(report.corners)
        elif report.box is not None:
            self._follow_box(report.box, report.angle)

    @property
    def corners(self) -> Array:
        """Corners (4, 2) [px] that were reported last, in the order of `Region.corners`; before any
        were reported, those of the region in the first picture. Reported boxes do not change them.
        """
        return self._last

    def _follow_box(self, box: Array, angle: float | None) -> None:
        """Set `state` by a box (4,) of left, top, width, height [px], turned by an angle [rad]."""
        first = np.array([self._first.x, self._first.y])
        area = self._own_area
        if angle is None:
            first = self._around[:2] + self._around[2:] / 2
            area = float(self._around[2] * self._around[3])
        centre = box[:2] + box[2:] / 2 - first
        grown = math.log(float(box[2] * box[3]) / area) / 2
        self.turns = self.turns or angle is not None
        turn = 0.0 if angle is None else self._continued(angle - self._first.theta)
        self._move(centre, turn, grown)

    def _follow_corners(self, corners: Array) -> None:
        """Set `state` by the corners (4, 2) of a convex quadrilateral [px], from any corner on."""
        ordered = (corners[order] for order in ORDERS)
        # Trackers begin with any corner: the order nearest to the last corners is the region's.
        seen = min(filter(goes_around, ordered), key=self._distance)
        self._last = seen
        moved = seen.mean(axis=0) - self._corners.mean(axis=0)
        # A similarity is a complex factor: the least-squares one is <was, now> / <was, was>.
        was, now = (_complex(c - c.mean(axis=0)) for c in (self._corners, seen))
        factor = complex(np.vdot(was, now) / np.vdot(was, was))
        self.turns = self.turns or not is_upright(seen)
        self.tilts = self.tilts or not _is_rectangle(seen)
        turn = self._continued(float(np.angle(factor)))
        self._move(moved, turn, math.log(max(abs(factor), SMALLEST_FACTOR)))

    def _continued(self, turn: float) -> float:
        """Return an angle from the first state [rad] plus the whole turns that bring it nearest to
        the last one: the angle of a state is continuous.
        """
        before = self.state.theta - self._first.theta
        return turn + 2 * math.pi * round((before - turn) / (2 * math.pi))

    def _move(self, moved: Array, turn: float, grown: float) -> None:
        """Set `state` to the first state plus a motion (2,) [px], a turn [rad] and a change of ln
        scale, the last two as far as the tracker measures them.
        """
        self._log_size = grown if self._log_size is None else self._log_size
        if self._gives is not None:
            self.resizes = self._sizes and "size" in self._gives
            self.turns = self.turns and "angle" in self._gives
        elif abs(grown - self._log_size) > RESIZED:
            self.resizes = self._sizes
        self.state = self._first.moved(
            np.array([*moved, turn if self.turns else 0.0, grown if self.resizes else 0.0])
        )

    def _distance(self, corners: Array) -> float:
        """Return the sum of squared distances [px^2] of corners (4, 2) from the last ones, both
        relative to their centres.
        """
        around = self._last - self._last.mean(axis=0)
        return float(np.square(corners - corners.mean(axis=0) - around).sum())


def _complex(points: Array) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def _is_rectangle(corners: Array) -> bool:
    """Return True if the angles of a quadrilateral (4, 2) [px] are right angles."""
    sides = np.diff(corners, axis=0, append=corners[:1])
    directions = sides / np.linalg.norm(sides, axis=1)[:, None]
    cosines = (directions * np.roll(directions, -1, axis=0)).sum(axis=1)
    return bool(np.abs(cosines).max() <= SQUARE)
