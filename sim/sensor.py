"""What happens between the light and the numbers: averaging, the lens, brightness, noise."""

import numpy as np

from sim.camera import CameraConfig
from sim.lens import Lens
from sim.types import Image

NOISE_MARGIN = 64
"""The noise tile is this much larger than the image [px], so that it can lie differently in each
frame.
"""


class Sensor:
    """Makes the frame from pictures of the lens's view."""

    def __init__(self, config: CameraConfig, lens: Lens, rng: np.random.Generator) -> None:
        self._size = (config.height, config.width)
        self._lens, self._rng = lens, rng
        self._noise = None
        if config.noise > 0:
            tile = (config.height + NOISE_MARGIN, config.width + NOISE_MARGIN, 3)
            self._noise = rng.normal(0.0, config.noise, tile).astype(np.float32)

    def develop(self, pictures: list[Image], gain: float) -> Image:
        """The read-only frame from the pictures (H, W, 3) taken over one exposure.

        The lens bends their mean, once a frame, as it would bend each of them.
        """
        if len(pictures) == 1 and gain == 1.0 and self._noise is None:
            image = self._lens.bend(pictures[0])
        else:
            mean = np.asarray(np.mean(pictures, axis=0, dtype=np.float32))
            light = self._lens.bend(mean) * np.float32(gain)
            if self._noise is not None:
                top, left = self._rng.integers(0, NOISE_MARGIN, 2)
                light += self._noise[top : top + self._size[0], left : left + self._size[1]]
            image = np.clip(np.rint(light), 0, 255).astype(np.uint8)
        image.setflags(write=False)
        return image
