"""The lens between a rendered pinhole picture and the camera's own, distorted one."""

from typing import Any, final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.camera import border
from sim.types import Array, Camera

SHARP = 0.8
"""On the optical axis the rendered picture has at least this many pixels for one of the camera's.
"""
LARGEST = 4
"""The rendered picture is at most this many times as wide, and as high."""


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
            at = (self.view.to_pixels(rays) - 0.5).astype(np.float32)
            self._maps = cv2.convertMaps(at, None, cv2.CV_16SC2)  # type: ignore[call-overload]

    def bend(self, picture: NDArray[Any]) -> NDArray[Any]:
        """The camera's picture (H, W, 3) of what `view` sees."""
        if self._maps is None:
            return picture
        return cv2.remap(picture, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

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
