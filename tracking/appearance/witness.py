"""A second witness beside the colours: the layout of the target's grey levels, which a histogram
does not know.

It consists of a correlation filter and of two templates, the first picture of the target and a slow
mean of later ones (Kalal, Mikolajczyk, Matas 2012, "Tracking-learning-detection", PAMI 34(7),
keeps such pictures to find a lost target again). Colours and filter are added because they err
differently: a filter fails where the target deforms, colours where something has the same
(Bertinetto, Valmadre, Golodetz, Miksik, Torr 2016, "Staple: Complementary learners for real-time
tracking", CVPR).
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking.appearance.correlation_filter import CorrelationFilter
from tracking.appearance.turned_back import between_centres, turned_back
from tracking.loops import correlation_filter as loops
from tracking.types import Region, State

# Chosen on 21 annotated recordings with one left out (tracking/RESULTS.md).
POINTS = 100
"""Number of points of a template, about."""
TEMPLATE_RATE = 0.02
"""Weight of the present picture in the later template."""
LEAST, MOST = -0.05, 0.6
"""Range of the filter's answers that are told apart."""
BY_ANSWER = 0.8
"""Weight of 1 - answer / `MOST` in the energy, where the filter has fared well."""
BY_TEMPLATE = 0.3
"""Weight of 1 - correlation with a template in the energy."""
FARED = 0.05
"""Weight of the present picture in the mean answer at the target, by which the filter is judged."""
WELL = 0.25
"""Mean answer from which the filter has its full weight: below, it fails to follow the target."""
REACH = 2.0
"""Radius around the target that is seen, over half of the window's longer side."""
ALIKE = 0.3
"""Least correlation with a template at a place where a lost target is searched."""
PLACES = 5
"""Most places at which a lost target is searched."""
LARGEST = 800
"""Most points along a side of the whole picture in a search."""
LEAST_SIDE = 4
"""Least points along a side of a template in a search: fewer tell nothing apart."""


class Witness:
    """A correlation filter and two templates (grey pictures) of one target, which judge states by
    the layout of its grey levels.

    For each picture call `look` first; `energy`, `signs`, `learn`, `fare` and `peak` then refer to
    that picture. `places` takes a picture of its own.
    """

    def __init__(self, image: Image, region: Region, state: State) -> None:
        """Learn the target from the first picture.

        Args:
            image: First picture, RGB (H, W, 3).
            region: The target's rectangle [px].
            state: State of the target in that picture.
        """
        self._region = region
        self._filter = CorrelationFilter(region)
        step = math.sqrt(region.width * region.height / POINTS)
        columns, rows = (max(round(side / step), 2) for side in (region.width, region.height))
        self._shape = rows, columns
        u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
        sides = (region.width, region.height)
        self._points = (np.stack([u.ravel(), v.ravel()], axis=1) - 0.5) * sides
        self._fared = 1.0
        self._see(image, state)
        self._templates = np.stack([self._template(state)] * 2)
        self._filter.learn(self._levels(state, self._filter.points))

    def look(self, image: Image, state: State) -> None:
        """Store the grey levels of a picture, RGB (H, W, 3), around the state at which the target
        is expected, and compute the output of the correlation filter there.
        """
        self._see(image, state)
        self._expected = state
        self._filter.read(self._levels(state, self._filter.points))

    def energy(self, states: Array) -> Array:
        """Return the energy (N,), from 0 (like the target) to about 1.5, of states (N, 4), x, y
        [px], theta [rad], ln scale, in the picture that `look` stored, by the filter's output and
        the larger correlation with a template. A particle filter adds it to the energy of the
        colours.
        """
        answers = np.clip(self._answers(self._filter.answer, states), LEAST, MOST)
        alike = self._correlations(states).max(axis=1)
        weight = BY_ANSWER * min(max(self._fared / WELL, 0.0), 1.0)
        return weight * (1 - answers / MOST) + BY_TEMPLATE * (1 - alike)

    def signs(self, state: State) -> tuple[float, float]:
        """Return two measures of whether the target is at a state in the picture that `look`
        stored: the output of the slowly learning filter, up to about 1 and -0.05 outside its
        window, and the correlation with the template from the first picture, -1..1.
        """
        at = state.vector[None]
        answer = self._answers(self._filter.slow_answer, at)
        return float(answer[0]), float(self._correlations(at)[0, 0])

    def learn(self, state: State) -> None:
        """Update the filter and the later of the two templates from the picture that `look` stored,
        in which the target is at `state`; the template from the first picture stays.
        """
        self._filter.learn(self._levels(state, self._filter.points))
        later = self._templates[1]
        later += TEMPLATE_RATE * (self._template(state) - later)
        later /= max(float(np.linalg.norm(later)), loops.LEAST)

    def fare(self, state: State) -> None:
        """Update the running mean of the filter's output at the target by its output at `state`,
        the final estimate in the picture that `look` stored. The lower this mean is
        (below 0.25), the less weight `energy` gives the filter.
        """
        answer = float(self._answers(self._filter.answer, state.vector[None])[0])
        self._fared += FARED * (answer - self._fared)

    def peak(self) -> State:
        """Return the state at the largest output of the filter in the picture that `look` stored:
        it has the angle and the size of the state that `look` was given, and lies in the window
        around it.
        """
        c, s = math.cos(self._expected.theta), math.sin(self._expected.theta)
        x, y = self._expected.scale * np.array([[c, -s], [s, c]]) @ self._filter.peak
        return self._expected.moved(np.array([x, y, 0.0, 0.0]))

    def places(self, image: Image, last: State) -> list[State]:
        """Return up to five states anywhere in a picture at which the correlation with a template
        of the target is largest, and at least 0.3, the best first. The list is empty for a picture
        that is smaller than the target. Where a template's points would make the picture larger
        than 800 points along a side, both have fewer points.

        Args:
            image: The picture, RGB (H, W, 3).
            last: Last state of the target, whose angle and size are searched, and which the results
                have.
        """
        templates, (rows, columns) = self._templates.astype(np.float32), self._shape
        size = last.scale * np.array([self._region.width, self._region.height])
        place, points = turned_back(image, last.theta, size / (columns, rows))
        if (coarser := float(points.max()) / LARGEST) > 1:
            rows, columns = (max(round(side / coarser), LEAST_SIDE) for side in self._shape)
            templates = [
                cv2.resize(
                    template.reshape(self._shape), (columns, rows), interpolation=cv2.INTER_AREA
                )
                for template in templates
            ]
            place, points = turned_back(image, last.theta, size / (columns, rows))
        shape = np.round(points).astype(int).tolist()
        if shape[0] < columns or shape[1] < rows:
            return []
        small, place = _reduced(image, last.theta, place, shape)
        maps = [
            cv2.matchTemplate(small, template.reshape(rows, columns), cv2.TM_CCOEFF_NORMED)
            for template in templates
        ]
        alike = np.nan_to_num(np.max(maps, axis=0), posinf=-1)
        found: list[State] = []
        for _ in range(PLACES):
            _, value, _, (x, y) = cv2.minMaxLoc(alike)
            if value < ALIKE:
                break
            u, v = (place @ [x + columns / 2, y + rows / 2, 1.0]).tolist()
            found.append(State(u, v, last.theta, last.scale))
            # Not the same peak again.
            left, top = max(x - columns // 2, 0), max(y - rows // 2, 0)
            alike[top : y + rows // 2 + 1, left : x + columns // 2 + 1] = -1
        return found

    def _see(self, image: Image, state: State) -> None:
        """Store the grey levels around a state, reduced by a whole number so that a pixel is about
        as large as the distance of two points of the filter's window.
        """
        shrink = max(int(self._filter.step / 2 * state.scale + 0.25), 1)
        radius = REACH * float(np.abs(self._filter.points).max()) * state.scale + shrink
        height, width = image.shape[:2]
        left, right = _span(state.x, radius, width, shrink)
        top, bottom = _span(state.y, radius, height, shrink)
        part = np.ascontiguousarray(image[top:bottom, left:right])
        grey = cv2.cvtColor(part, cv2.COLOR_RGB2GRAY)
        size = (max((right - left) // shrink, 2), max((bottom - top) // shrink, 2))
        smaller = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        self._grey = smaller.astype(np.float32)
        self._from = np.array([left, top, 0.0, 0.0])
        self._to = np.array([shrink, shrink, 1.0, 1.0])
        self._larger = np.array([0.0, 0.0, 0.0, math.log(shrink)])

    def _inside(self, states: Array) -> Array:
        """Return states (N, 4) in pixels of the stored grey levels."""
        return (states - self._from) / self._to - self._larger

    def _levels(self, state: State, points: Array) -> Array:
        return loops.patch(self._grey, self._inside(state.vector), points)

    def _correlations(self, states: Array) -> Array:
        """Return the correlations (N, 2) of states (N, 4) with the templates."""
        return loops.correlations(self._grey, self._inside(states), self._points, self._templates)

    def _answers(self, answers: Array, states: Array) -> Array:
        at = self._expected.vector
        return loops.looked_up(answers, states, at, self._filter.step, LEAST)

    def _template(self, state: State) -> Array:
        """Return the grey levels of the target at a state, of mean 0 and length 1; zeros if there
        is no contrast.
        """
        levels = self._levels(state, self._points)
        levels -= levels.mean()
        norm = float(np.linalg.norm(levels))
        return levels / norm if norm > loops.LEAST else np.zeros_like(levels)


def _reduced(
    image: Image, theta: float, place: Array, shape: tuple[int, int]
) -> tuple[NDArray[np.float32], Array]:
    """Return the grey levels of a picture, reduced and turned back by an angle, and the affine
    matrix (2, 3) from their coordinates to the picture's [px].

    Args:
        image: The picture, RGB (H, W, 3).
        theta: The angle [rad].
        place: The affine matrix for this angle, before the size was rounded.
        shape: Width and height of the result.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if theta == 0:
        small = cv2.resize(grey, shape, interpolation=cv2.INTER_AREA)
        height, width = grey.shape
        return small.astype(np.float32), np.diag([width / shape[0], height / shape[1], 1.0])[:2]
    # Each point is the mean of about as many pixels as it stands for.
    steps = np.linalg.norm(place[:, :2], axis=0)
    blurred = cv2.blur(grey, [max(int(step), 1) for step in steps])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    small = cv2.warpAffine(
        blurred, between_centres(place), shape, flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return small.astype(np.float32), place


def _span(middle: float, radius: float, most: int, shrink: int) -> tuple[int, int]:
    """Return first pixel and end of a range around a place, inside 0 .. most, at least 2 and if
    possible a multiple of `shrink` long.
    """
    low = min(max(int(middle - radius), 0), max(most - 2 * shrink, 0))
    high = min(max(math.ceil(middle + radius), low + 2 * shrink), most)
    return low, low + max((high - low) // shrink * shrink, min(2, most))
