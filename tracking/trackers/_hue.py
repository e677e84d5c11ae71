"""A hue histogram, back-projected as a ratio (Swain, Ballard 1991), and the base class of trackers
by OpenCV that are judged by it.
"""

from abc import abstractmethod

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Frame, Image
from tracking.guests.boxes import box_of
from tracking.loss import LossJudge, LossLimits
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    check_picture,
    check_region,
    unknown_covariance,
)

# As OpenCV's own sample program of CamShift has them, which most users start from.
BINS = 16
"""Number of hue bins."""
LEAST_SATURATION = 60
"""Least saturation, 0..255, of a pixel that counts: the hue of greyer ones is noise."""
LEAST_VALUE = 32
"""Least value, 0..255, of a pixel that counts: the hue of darker ones is noise."""
ENDS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 10, 1)
"""OpenCV's mean shift ends after ten iterations, or after a step below one pixel."""
LIMITS = LossLimits(floor=0.4, cap=0.7)
"""Limits of the distance of hue histograms; chosen by hand on painted sequences."""


class HueModel:
    """Hue histogram of the target, which is `region` at `state` in a first RGB picture; its
    back-projection, and the distance of any state from it.
    """

    def __init__(self, image: Image, region: Region, state: State) -> None:
        self._region = region
        self._reference, counted = self._histogram(image, state)
        whole, mask = self._hsv(image)
        everywhere = self._counts(whole, mask)
        # Swain and Ballard's ratio: a hue that the background has too says little. Without it a
        # little background in the histogram makes CamShift grow until it fills the picture.
        self._ratio = np.minimum(counted * self._reference / np.maximum(everywhere, 1.0), 1.0)

    def back_projection(self, image: Image) -> NDArray[np.uint8]:
        """Return the back-projection (H, W), 0..255, of a picture, RGB (H, W, 3): for each pixel
        the share of the target among all pixels of its hue in the first picture, scaled so that the
        likeliest hue gets 255; 0 for grey and dark pixels.
        """
        hsv, mask = self._hsv(image)
        # Mean shift is the same for any common factor: the likeliest hue gets 255.
        scaled = self._ratio / max(float(self._ratio.max()), 1e-12) * 255
        likely = cv2.calcBackProject([hsv], [0], scaled.astype(np.float32), [0, 180], 1)
        return cv2.bitwise_and(likely, mask).astype(np.uint8)

    def distance(self, image: Image, state: State) -> float:
        """Return the Bhattacharyya distance, 0..1, of the hue histogram at a state from the
        target's.
        """
        rho = float(np.sqrt(self._reference * self._histogram(image, state)[0]).sum())
        return float(np.sqrt(max(1.0 - rho, 0.0)))

    def _histogram(self, image: Image, state: State) -> tuple[Array, float]:
        """Return the hue histogram (`BINS`,) of the ellipse in the turned region, which sums to 1,
        or to 0 if all its pixels are grey or dark, and the number of pixels that it counts.
        """
        x, y, width, height = box_of(self._region, state, image)
        hsv, mask = self._hsv(image[y : y + height, x : x + width])
        inside = np.zeros_like(mask)
        size = (self._region.width * state.scale, self._region.height * state.scale)
        # OpenCV's coordinates begin in the middle of the first pixel, ours at its corner.
        centre = (state.x - x - 0.5, state.y - y - 0.5)
        cv2.ellipse(inside, (centre, size, float(np.degrees(state.theta))), 255, -1)
        counts = self._counts(hsv, cv2.bitwise_and(mask, inside).astype(np.uint8))
        total = float(counts.sum())
        return counts / max(total, 1.0), total

    def _counts(self, hsv: Image, mask: NDArray[np.uint8]) -> Array:
        return cv2.calcHist([hsv], [0], mask, [BINS], [0, 180]).ravel().astype(np.float64)

    def _hsv(self, image: Image) -> tuple[Image, NDArray[np.uint8]]:
        hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV).astype(np.uint8)
        # The hue of grey and of dark pixels is noise (Bradski 1998).
        low = np.array([0, LEAST_SATURATION, LEAST_VALUE])
        return hsv, cv2.inRange(hsv, low, np.array([180, 255, 255])).astype(np.uint8)


class HueTracker:
    """Base class of trackers whose position comes from a search of OpenCV, and whose status comes
    from the hue histogram at that position.
    """

    follows = (False, False)
    """Whether the tracker follows the angle, and the size."""
    _region: Region = SET_BY_START

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's hue histogram.

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        check_region(frame, region, state)
        self._region = region
        self._state = state
        self._loss = LossJudge(LIMITS)
        self._model = HueModel(frame.image, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate of OpenCV's search, with the status from the hue histogram's
        distance.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale since the last frame that the
                camera's own motion causes; None if it is unknown.
        """
        check_picture(frame.image)
        self._state = self._found(frame, ego)
        distance = self._model.distance(frame.image, self._state)
        status = self._loss.judge(distance, frame.time)
        return Estimate(self._state, unknown_covariance(), distance, status, self.follows)

    @abstractmethod
    def _found(self, frame: Frame, ego: Array | None) -> State:
        """Return the target's state in a frame; its last state if the search does not find it."""
