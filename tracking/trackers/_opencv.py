"""What the reference trackers made of OpenCV's share: a hue histogram, which judges them."""

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from sim.types import Array, Frame, Image
from tracking.external.boxes import Box, box_of
from tracking.lock import Lock, LockConfig
from tracking.types import Estimate, Region, State, check_region, unknown_covariance


@dataclass(frozen=True, slots=True)
class HueSettings:
    """A hue histogram, back-projected as a ratio (Swain, Ballard 1991)."""

    bins: Annotated[int, Ge(2), Le(180)] = 16
    """Number of hue bins."""
    least_saturation: Annotated[int, Ge(0), Le(255)] = 60
    """Greyer pixels do not count."""
    least_value: Annotated[int, Ge(0), Le(255)] = 32
    """Darker pixels do not count."""
    steps: Annotated[int, Ge(1), Le(1000)] = 10
    """Most iterations of mean shift."""
    lock: LockConfig = field(default_factory=lambda: LockConfig(floor=0.4, cap=0.7))
    """When the target counts as hidden or lost."""


class HueModel:
    """Hue histogram of a region, its back-projection, and the distance at another state."""

    def __init__(self, image: Image, region: Region, state: State, settings: HueSettings) -> None:
        self._settings = settings
        self._region = region
        self._reference, counted = self._histogram(image, state)
        whole, mask = self._hsv(image)
        everywhere = self._counts(whole, mask)
        # Swain and Ballard's ratio: a hue that the background has too says little. Without it a
        # little background in the histogram makes CamShift grow until it fills the picture.
        self._ratio = np.minimum(counted * self._reference / np.maximum(everywhere, 1.0), 1.0)

    def back_projection(self, image: Image) -> NDArray[np.uint8]:
        """How likely each pixel is the target's (H, W), 0..255."""
        hsv, mask = self._hsv(image)
        scaled = self._ratio / max(float(self._ratio.max()), 1e-12) * 255
        histogram = scaled.astype(np.float32)
        likely = cv2.calcBackProject([hsv], [0], histogram, [0, 180], 1)
        return cv2.bitwise_and(likely, mask).astype(np.uint8)

    def distance(self, image: Image, state: State) -> float:
        """Bhattacharyya distance, 0..1."""
        rho = float(np.sqrt(self._reference * self._histogram(image, state)[0]).sum())
        return float(np.sqrt(max(1.0 - rho, 0.0)))

    def _histogram(self, image: Image, state: State) -> tuple[Array, float]:
        """Of the ellipse in the region as it is turned, with the number of pixels it counts."""
        x, y, width, height = box_of(self._region, state, image)
        hsv, mask = self._hsv(image[y : y + height, x : x + width])
        inside = np.zeros_like(mask)
        size = (self._region.width * state.scale, self._region.height * state.scale)
        centre = (state.x - x - 0.5, state.y - y - 0.5)
        cv2.ellipse(inside, (centre, size, float(np.degrees(state.theta))), 255, -1)
        counts = self._counts(hsv, cv2.bitwise_and(mask, inside).astype(np.uint8))
        total = float(counts.sum())
        return counts / max(total, 1.0), total

    def _counts(self, hsv: Image, mask: NDArray[np.uint8]) -> Array:
        counts = cv2.calcHist([hsv], [0], mask, [self._settings.bins], [0, 180])
        return counts.ravel().astype(np.float64)

    def _hsv(self, image: Image) -> tuple[Image, NDArray[np.uint8]]:
        hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV).astype(np.uint8)
        low = np.array([0, self._settings.least_saturation, self._settings.least_value])
        return hsv, cv2.inRange(hsv, low, np.array([180, 255, 255])).astype(np.uint8)


class HueTracker:
    """A search of OpenCV's, whose result a hue histogram judges."""

    follows = (False, False)
    """Whether it follows angle, and size."""

    def __init__(self, config: HueSettings) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram."""
        check_region(frame, region, state)
        self._region = region
        self._state = state
        self._lock = Lock(self._config.lock)
        self._model = HueModel(frame.image, region, state, self._config)
        self._begin(frame, box_of(region, state, frame.image))

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Search, and judge."""
        self._state = self._found(frame, ego)
        distance = self._model.distance(frame.image, self._state)
        status = self._lock.judge(distance, frame.time)
        return Estimate(self._state, unknown_covariance(), distance, status, self.follows)

    def _ends(self) -> tuple[int, int, int]:
        """When OpenCV's mean shift ends."""
        return cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self._config.steps, 1

    @abstractmethod
    def _begin(self, frame: Frame, box: Box) -> None:
        """Take the first frame, with the target's box."""

    @abstractmethod
    def _found(self, frame: Frame, ego: Array | None) -> State:
        """Where the target is; its last state where it is not found."""
