"""From rendered pinhole pictures to the frame: the lens, then averaging, brightness and noise."""

from typing import Any, final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.camera import CameraConfig, border
from sim.types import Array, Camera, Image

SHARP = 0.8
"""On the optical axis the rendered picture has at least this many pixels for one of the camera's.
"""
LARGEST = 4
"""The rendered picture is at most this many times as wide, and as high."""
NOISE_MARGIN = 64
"""The noise tile is this much larger than the image [px], so that it can lie differently in each
frame.
"""


@final
class Lens:
    """Bends pictures; a camera without distortion has a lens that leaves them as they are."""

    def __init__(self, camera: Camera) -> None:
        self.view = camera if camera.distortion is None else _view(camera)
        """The pinhole camera whose pictures are bent: it covers all that the camera sees."""
        self._maps: tuple[Any, Any] | None = None
        if camera.distortion is not None:
            v, u = np.mgrid[: camera.height, : camera.width] + 0.5
            rays = camera.normalise(np.stack([u, v], axis=-1))
            # OpenCV's coordinates start at the middle of a pixel.
            # Floats on four channels: three times as fast as integers on three.
            self._maps = (self.view.to_pixels(rays) - 0.5).astype(np.float32), None

    def bend(self, picture: NDArray[Any]) -> NDArray[Any]:
        """The camera's picture (H, W, 3) of what `view` sees."""
        if self._maps is None:
            return picture
        four = cv2.cvtColor(picture, cv2.COLOR_RGB2RGBA)
        bent = cv2.remap(four, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return cv2.cvtColor(bent, cv2.COLOR_RGBA2RGB)

    def count(self, mask: NDArray[np.bool_]) -> int:
        """Pixels of the camera's picture in which a mask of `view`, of any size, is set."""
        if self._maps is None:
            return int(mask.sum())
        size = self.view.width, self.view.height
        whole = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        return int(cv2.remap(whole, *self._maps, cv2.INTER_NEAREST).sum())


def _view(camera: Camera) -> Camera:
    """The pinhole camera whose image is the rectangle around all rays that a camera sees."""
    rays = camera.normalise(border(camera))
    low, span = rays.min(axis=0), np.ptp(rays, axis=0)
    own: Array = np.array([camera.width, camera.height])
    size = np.clip(np.ceil(SHARP * span * (camera.fx, camera.fy)), own, LARGEST * own)
    (fx, fy), (cx, cy) = (size / span).tolist(), (-low * size / span).tolist()
    return Camera(fx, fy, cx, cy, *size.astype(int).tolist())


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
