"""Views of the target: pictures of 8 x 8 points, by which it is recognised by normalised
correlation.

Stored are the view in the first picture and some later ones in which the target was certain (Kalal,
Mikolajczyk, Matas 2012).
"""

import math

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.appearance.layout import lattice
from tracking.appearance.turned_back import between_centres, turned_back
from tracking.loops import view_correlation as loops
from tracking.types import Region, State

# Chosen by hand on 13 annotated recordings (tracking/RESULTS.md).
SIDE = 8
"""Number of points along each side of a view."""
NEW = 0.9
"""Correlation with a stored view above which a view is not new."""
SIZES = (0.8, 1.0, 1.25)
"""Factors on the last size at which the whole picture is searched."""
LARGEST = 1024
"""Most points along a side of what is searched: of a larger picture, the part around the target's
last place."""
APART = SIDE // 2
"""Least distance of two candidates of one size [points of a view]."""


class Views:
    """Stored views (pictures of 8 x 8 points) of the target, at most `count`: the first, from the
    first picture, in which the target is the rectangle `region` [px] at `state`, and the newest
    ones that `learn` stored.
    """

    def __init__(self, image: Image, region: Region, state: State, count: int) -> None:
        """Store the first view, a small picture of the target in the first frame.

        Args:
            image: First frame (H, W, 3).
            region: The target's rectangle [px].
            state: State of the target in that picture.
            count: Largest number of stored views.
        """
        self._points = lattice(SIDE, region)
        self._region = region
        self._count = count
        self._scale = state.scale
        self._stored = self._view(self.blurred(image), state)

    def blurred(self, image: Image) -> Image:
        """Return a picture (H, W, 3) blurred for the comparison with views (pictures of 8 x 8
        points of the target): each pixel is the mean over an area of 1/8 of the target's width by
        1/8 of its height, at the size that the target had when `learn` was called last, or else
        in the first picture.
        """
        sides = (self._region.width, self._region.height)
        width, height = (
            min(max(round(side * self._scale / SIDE), 1), most)
            for side, most in zip(sides, image.shape[1::-1], strict=True)
        )
        return np.asarray(cv2.blur(image, (width, height)), np.uint8)

    def likeness(self, blurred: Image, states: Array) -> Array:
        """Return the largest correlation (N,), -1..1, of the picture at each of N states with a
        stored view (picture of 8 x 8 points of the target).

        Args:
            blurred: The picture, RGB (H, W, 3), as the method `blurred` returns it.
            states: States (N, 4): x, y [px], theta [rad], ln scale.
        """
        return loops.correlations(blurred, states, self._points, self._stored)

    def learn(self, blurred: Image, state: State) -> None:
        """Store the picture of 8 x 8 points of the target at a state, where it certainly is, as a
        view, unless its correlation with a stored view is above 0.9.

        When there are `count` views already, the new one replaces the oldest but the first; with
        `count` = 1 only the first view is kept. In any case the method `blurred` uses the size at
        this state from now on.

        Args:
            blurred: The picture, RGB (H, W, 3), as the method `blurred` returns it.
            state: State of the target in the picture.
        """
        self._scale = state.scale
        if self._count > 1 and float(self.likeness(blurred, state.vector[None])[0]) <= NEW:
            newest = self._stored[max(len(self._stored) - self._count + 2, 1) :]
            stored = np.vstack([self._stored[:1], newest, self._view(blurred, state)])
            # By columns, as NumPy may join them, numba would compile the loop a second time.
            self._stored = np.ascontiguousarray(stored)

    def search(self, blurred: Image, last: State, most: int) -> Array:
        """Return the states (n, 4) anywhere in a picture that are most similar to a stored view
        (picture of 8 x 8 points of the target), the most similar first.

        Args:
            blurred: The picture, RGB (H, W, 3), as the method `blurred` returns it.
            last: The target's last state: its angle is kept, and 0.8, 1 and 1.25 times its size are
                searched.
            most: Largest number n of states.

        Returns:
            States of x, y [px], theta [rad], ln scale; n = 0 if, at all three sizes, the
            picture is smaller than a view. Of a picture with more than 1024 points of a view along
            a side, only 1024 around the last place are searched.
        """
        found: list[tuple[float, list[float]]] = []
        for scale in (last.scale * size for size in SIZES):
            shrunk = self._shrunk(blurred, last, scale)
            if shrunk is None:
                continue
            small = shrunk[0].astype(np.float32)
            place = shrunk[1]
            maps = [
                cv2.matchTemplate(
                    small, stored.reshape(SIDE, SIDE, 3).astype(np.float32), cv2.TM_CCOEFF_NORMED
                )
                for stored in self._stored
            ]
            alike = np.nan_to_num(np.max(maps, axis=0), posinf=-1)
            for _ in range(most):
                _, value, _, (x, y) = cv2.minMaxLoc(alike)
                centre = place @ [x + SIDE / 2, y + SIDE / 2, 1.0]
                found.append((value, [*centre.tolist(), last.theta, math.log(scale)]))
                # Not the same peak again.
                alike[max(y - APART, 0) : y + APART + 1, max(x - APART, 0) : x + APART + 1] = -1
        # Sizes compete by their correlations, which do not depend on size.
        found.sort(key=lambda item: -item[0])
        return np.array([state for _, state in found[:most]]).reshape(-1, 4)

    def _shrunk(self, image: Image, last: State, scale: float) -> tuple[Image, Array] | None:
        """Return the picture turned back by the target's last angle and reduced until one pixel
        covers the area between two points of a stored view of the target, or the part of it around
        the target's last place that is at most `LARGEST` wide and high; also the affine matrix
        (2, 3) from its coordinates to the picture's. Return None if it is smaller than a view.
        """
        steps = scale / SIDE * np.array([self._region.width, self._region.height])
        place, size = turned_back(image, last.theta, steps)
        if size.min() < SIDE:
            return None
        middle = np.linalg.solve(place[:, :2], [last.x, last.y] - place[:, 2])
        begin = np.clip(np.rint(middle - LARGEST / 2), 0, np.maximum(np.ceil(size) - LARGEST, 0))
        place[:, 2] += place[:, :2] @ begin
        size = np.minimum(size, LARGEST)
        shape = (round(size[0]), round(size[1]))
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        small = cv2.warpAffine(image, between_centres(place), shape, flags=flags)
        return np.asarray(small, np.uint8), place

    def _view(self, blurred: Image, state: State) -> Array:
        return loops.view(blurred, state.vector, self._points)[None]
