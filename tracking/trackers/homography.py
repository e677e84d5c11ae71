"""Tracker of a textured plane, which is aligned directly, by the brightness of its pixels, with
eight degrees of freedom.

Baker, Matthews 2004, "Lucas-Kanade 20 Years On: A Unifying Framework" (International Journal of
Computer Vision 56(3)), inverse compositional; Tukey's weights as in Hager, Belhumeur 1998,
"Efficient Region Tracking with Parametric Models of Geometry and Illumination" (TPAMI 20(10)).
"""

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.outline import area
from sim.types import Array, Frame, Image
from tracking.guests.report import convex
from tracking.loops import plane_alignment
from tracking.loss import LossJudge, LossLimits
from tracking.search.velocity import Velocity
from tracking.trackers._plane import SQUARE, homography, state_of, through
from tracking.types import (
    FARTHEST,
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    Trait,
    check_picture,
    check_region,
    unknown_covariance,
)

Level = tuple[int, Array, Array, Array, NDArray[np.intp]]
"""Number of points of a template; those (n, 2) that were seen, their brightness (n,), its
derivatives (n, 8), and the cells of the template that they are in (n,)."""
Alignment = tuple[Array, Array, float, float]
"""Corners (4, 2), gain and bias of the light (2,), correlation 0..1, misfit."""

# All numbers were chosen by hand on rendered plates of 150 px in six degrees of freedom, plain and
# with a part hidden (tracking/RESULTS.md has the errors that they give).
POINTS = 60
"""Points of the template along each side."""
COARSE = 4
"""Factor on the distance between the points of the template in the coarse alignment."""
CELL = 3
"""Least number of points along a side of a cell; a cell is hidden or seen as a whole."""
MOST_CELLS = 10
"""Most cells along the template's side."""
STEPS = 12
"""Most steps of a descent, on each of two levels."""
STILL = 2e-4
"""A step that moves the corners by less than this share of the template's side is the last."""
VELOCITY_MEMORY = 0.5
"""Share of the old velocity that the new one keeps."""
TRIES = 15
"""Number of states around the last one from which a target that is not seen is searched in a
frame."""
SPREAD = np.array([0.3, 0.3, 0.3, 0.1])
"""Standard deviations of these states: of x and y over the target's size, of the angle [rad], of ln
scale."""
LIMITS = LossLimits(floor=0.2, cap=0.3)
"""Limits of the distance, which is 1 - the robust correlation of template and picture."""
AROUND = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Directions in which the derivatives of the brightness are taken."""
INSIDE = 0.4
"""Distance from the middle of the unit square at which the rim begins, where the ground around the
target shows."""
LEAST_CONTRAST = 3.0
"""With a smaller standard deviation of the brightness inside [grey levels] there is nothing to
align."""
SURE = 0.95
"""Correlation below which the coarse descent may have ended in a wrong minimum."""
WORSE = 0.2
"""Rise of the misfit (a logarithm) since the last frame from which on the coarse descent may have
ended in a wrong minimum: something begins to hide the target."""
LARGEST_GROWTH = 2.0
"""Largest factor on the size from picture to picture; a larger one is a failed descent."""


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `homography` has no settings."""

    traits = frozenset({Trait.TEXTURE, Trait.CORNERS})

    def build(self, rng: np.random.Generator) -> "Homography":
        """Return a new tracker. When it has lost its target, it searches from states that it draws
        from `rng`.
        """
        return Homography(rng)


@final
class Homography:
    """Tracker of a textured plane with eight degrees of freedom (a homography): in each frame it
    aligns the target's first picture with the frame, first with few points, then with many. A
    target that is not seen is also searched from states that `rng` draws around its last one.
    """

    _velocity: Velocity = SET_BY_START

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the template: the brightness of the target in the first frame, in which it is the
        rectangle `region` [px] at `state`, or has the corners `region.quad`. A target without
        texture, with a standard deviation below 3 grey levels, is reported as not seen in all later
        frames.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        check_region(frame, region, state)
        self._region = region
        self._state = state
        self._corners = region.first_corners(state)
        self._light = np.array([1.0, 0.0])
        self._loss = LossJudge(LIMITS)
        self._misfit = 0.0
        self._velocity = Velocity(state, VELOCITY_MEMORY)
        sides = (POINTS // COARSE, POINTS)
        self._levels = [self._learn(frame.image, side) for side in sides]
        _, points, seen, *_ = self._levels[1]
        inside = seen[np.abs(points).max(axis=1) < INSIDE]
        self._has_texture = inside.size > 0 and bool(np.std(inside) >= LEAST_CONTRAST)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate, with corners, from the alignment of the template with the next
        frame; it begins at the predicted corners. A target that is not seen keeps its last corners,
        moved by `ego`, and is searched around them in the next frame.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.
        """
        check_picture(frame.image)
        change = self._velocity.step(ego)
        followed = self._loss.locked
        expected = _moved(self._corners, self._state, change if followed else ego)
        before = state_of(expected, self._region, self._state)
        corners, light, found, misfit = self._descend(frame.image, expected, before)
        # A diverged descent often shrinks the quadrangle to a spot or stretches it.
        grown = np.log(state_of(corners, self._region, before).scale / before.scale)
        if abs(grown) > np.log(LARGEST_GROWTH) or not self._has_texture:
            found = 0.0
        status = self._loss.judge(1.0 - found, frame.time)
        seen = status is Status.LOCKED
        if seen:
            self._corners = corners
            self._light = light
            self._misfit = misfit
        else:
            self._corners = _moved(self._corners, self._state, ego)
        self._state = state_of(self._corners, self._region, before)
        if seen and not followed:
            # The jump to where the target came back is not its velocity.
            self._velocity = Velocity(self._state, VELOCITY_MEMORY)
        self._velocity.learn(self._state, seen=seen)
        return Estimate(
            self._state, unknown_covariance(), 1.0 - found, status, corners=self._corners
        )

    def _descend(self, image: Image, expected: Array, state: State) -> Alignment:
        """Return the alignment by a fine descent that begins at the best of the coarse ones.

        The coarse descents begin at the expected corners (4, 2) [px] and, if the target was not
        seen, at drawn states around them; the fine one may also begin at the expected corners.
        """
        begins = [expected]
        if not self._loss.locked:
            size = float(np.sqrt(self._region.area(state)))
            draws = self._rng.normal(0.0, SPREAD * (size, size, 1, 1), (TRIES, 4))
            begins += [_moved(expected, state, draw) for draw in draws]
        coarse, fine = self._levels
        aligned = [self._align(image, begin, self._light, coarse) for begin in begins]
        corners, light, found, _ = max(aligned, key=lambda aligned: aligned[2])
        best = self._align(image, corners, light, fine) if found > 0 else aligned[0]
        # The coarse descent may have ended in another minimum: try the fine one alone.
        if self._loss.locked and (best[2] < SURE or best[3] > self._misfit + WORSE):
            best = min(
                best,
                self._align(image, expected, self._light, fine),
                key=lambda aligned: aligned[3],
            )
        return best

    def _align(self, image: Image, corners: Array, light: Array, level: Level) -> Alignment:
        part, to_part = _part(image, corners, level[0])
        begin = to_part @ homography(SQUARE, corners)
        H, light, found, misfit = plane_alignment.align(part, begin, light, level[1:], STEPS, STILL)
        aligned = through(np.linalg.inv(to_part) @ H, SQUARE)
        if found > 0 and (np.abs(aligned) <= FARTHEST).all() and convex(aligned):
            return aligned, light, found, misfit
        return corners, light, 0.0, np.inf

    def _learn(self, image: Image, side: int) -> Level:
        """Return a template with `side` points along each side, read from the first picture."""
        middle = (np.arange(side) + 0.5) / side - 0.5
        points = np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 2)
        part, to_part = _part(image, self._corners, len(points))
        H = to_part @ homography(SQUARE, self._corners)
        seen = plane_alignment.sample(part, H, points)
        # Central differences over one step of the template's grid.
        step = 0.5 / side
        there = [plane_alignment.sample(part, H, points + d) for d in step * AROUND]
        gx = (there[0] - there[1]) / (2 * step)
        gy = (there[2] - there[3]) / (2 * step)
        # The steepest-descent images of Baker, Matthews (2004): gradient times the derivative of
        # the homography by its eight parameters at the identity.
        (x, y) = points.T
        slope = gx * points[:, 0] + gy * points[:, 1]
        rows = np.column_stack([gx * x, gx * y, gx, gy * x, gy * y, gy, -slope * x, -slope * y])
        hidden = np.isnan(seen) | np.isnan(rows).any(axis=1)
        wide = int(np.clip(side // CELL, 1, MOST_CELLS))
        cells = ((points + 0.5) * wide).astype(np.intp) @ np.array([1, wide])
        return side**2, points[~hidden], seen[~hidden], rows[~hidden], cells[~hidden]


def _part(image: Image, corners: Array, count: int) -> tuple[NDArray[np.float32], Array]:
    """Return the grey picture around a quadrangle (4, 2) [px], smoothed and, if it is larger,
    reduced to about `count` pixels inside the quadrangle; and the matrix (3, 3) from the
    coordinates of `image` to those of the reduced picture.
    """
    size = np.ptp(corners, axis=0)
    ends = np.array(image.shape[1::-1])
    low = np.clip(corners.min(axis=0) - size / 2, 0, ends - 1).astype(int)
    high = np.clip(corners.max(axis=0) + size / 2 + 1, low + 1, ends).astype(int)
    # About one pixel for each point of the template: means of pixels, and so no aliasing.
    shrink = int(np.clip(np.sqrt(area(corners) / count), 1, (high - low).min()))
    width, height = ((high - low) // shrink).tolist()
    cut = image[low[1] :, low[0] :][: height * shrink, : width * shrink]
    grey = cv2.cvtColor(np.ascontiguousarray(cut), cv2.COLOR_RGB2GRAY)
    grey = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(grey, (3, 3), 0).astype(np.float32)
    x, y = (-low / shrink).tolist()
    return smooth, np.array([[1 / shrink, 0, x], [0, 1 / shrink, y], [0, 0, 1.0]])


def _moved(corners: Array, state: State, change: Array | None) -> Array:
    """Return corners (4, 2) [px] after a change (4,) of x, y [px], theta [rad] and ln scale of the
    state to which they belong; unchanged if the change is None.
    """
    if change is None:
        return corners
    x, y, turn, grown = change.tolist()
    c = np.exp(grown) * np.cos(turn)
    s = np.exp(grown) * np.sin(turn)
    at = np.array([state.x, state.y])
    return (corners - at) @ np.array([[c, s], [-s, c]]) + at + (x, y)
