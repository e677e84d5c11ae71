"""The camera's lens and sensor: they turn rendered pinhole pictures into frames with distortion,
motion blur or a rolling shutter, brightness changes and noise.
"""

from collections.abc import Sequence
from math import exp
from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.camera.camera import CameraConfig, border
from sim.timing import Band
from sim.types import Array, Camera, DepthPicture, Image

SHARP = 0.8
"""On the optical axis the rendered picture has at least this many pixels for one of the camera's,
unless `LARGEST` limits its size.
"""
LARGEST = 4
"""The rendered picture is at most this many times as wide, and as high, as the camera's."""
NOISE_MARGIN = 64
"""The noise tile is this much larger than the image [px], so that it can lie differently in each
frame.
"""
ALL = slice(None)
GAINS = 1 / 8, 8.0
"""Range of an automatic gain."""


@final
class Lens:
    """Applies the distortion of a camera's lens to pictures. The pictures have to be rendered for
    the pinhole camera in the attribute `view`, which covers all that the camera sees; without
    distortion `view` is the camera itself, and pictures are returned unchanged.
    """

    def __init__(self, camera: Camera) -> None:
        self.view = camera if camera.distortion is None else _view(camera)
        """The pinhole camera whose pictures are bent: it covers all that the camera sees."""
        self._maps: NDArray[np.float32] | None = None
        """For each pixel of the camera its u and its v (2, H, W) in the picture of `view` [px],
        counted from the middle of the first pixel, as in OpenCV; None without distortion."""
        if camera.distortion is not None:
            v, u = np.mgrid[: camera.height, : camera.width] + 0.5
            rays = camera.normalise(np.stack([u, v], axis=-1))
            # OpenCV's coordinates start at the middle of a pixel.
            places = self.view.to_pixels(rays) - 0.5
            self._maps = np.ascontiguousarray(np.moveaxis(places, -1, 0), np.float32)

    def bend(self, picture: np.ndarray, rows: slice = ALL) -> np.ndarray:
        """Return the camera's distorted picture, RGB (H, W, 3), given the rendered picture (h, w,
        3) of the pinhole camera `view`. `rows` selects rows of the distorted picture; by default
        all are returned.
        """
        if self._maps is None:
            return picture if rows is ALL else picture[rows]
        # Four channels are three times as fast as three.
        four = cv2.cvtColor(picture, cv2.COLOR_RGB2RGBA)
        u, v = self._maps[:, rows]
        bent = cv2.remap(four, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return cv2.cvtColor(bent, cv2.COLOR_RGBA2RGB)

    def nearest(self, depth: DepthPicture) -> DepthPicture:
        """Return the camera's distorted depth picture (H, W) [m], given the rendered depth picture
        (h, w) [m] of the pinhole camera `view`. Each pixel has the depth of the nearest rendered
        pixel, because a mean across an edge would be the distance of no surface.
        """
        if self._maps is None:
            return depth
        return np.asarray(
            cv2.remap(depth, self._maps[0], self._maps[1], cv2.INTER_NEAREST), np.float32
        )

    def count(self, mask: NDArray[np.bool_]) -> int:
        """Return the number of pixels of the camera's distorted picture at which a mask (h, w),
        rendered for the pinhole camera `view`, is true.
        """
        if self._maps is None:
            return int(mask.sum())
        return int(
            cv2.remap(mask.astype(np.uint8), self._maps[0], self._maps[1], cv2.INTER_NEAREST).sum()
        )


def _view(camera: Camera) -> Camera:
    """Return the pinhole camera whose image is the rectangle around all rays that a camera sees."""
    rays = camera.normalise(border(camera))
    low = rays.min(axis=0)
    span = np.ptp(rays, axis=0)
    own: Array = np.array([camera.width, camera.height])
    size = np.clip(np.ceil(SHARP * span * (camera.fx, camera.fy)), own, LARGEST * own)
    (fx, fy) = (size / span).tolist()
    (cx, cy) = (-low * size / span).tolist()
    return Camera(fx, fy, cx, cy, *size.astype(int).tolist())


class Sensor:
    """Makes a camera's pictures from rendered pinhole pictures: adds motion blur, the effect of a
    rolling shutter, lens distortion, brightness, noise and automatic gain, as the settings `config`
    say.

    `bands` (`sim.timing.exposures`) says how a picture is exposed: for each group of rows, the
    physics steps whose rendered pictures are averaged; without bands all pictures of a frame are
    averaged. `rng` draws the noise.
    """

    def __init__(
        self,
        config: CameraConfig,
        lens: Lens,
        rng: np.random.Generator,
        bands: Sequence[Band] = (),
    ) -> None:
        self._size = (config.height, config.width)
        self._lens = lens
        self._rng = rng
        steps = sorted({k for band in bands for k in band.steps})
        self._bands = [
            (slice(b.begin, b.begin + len(b.weights)), b.weights, [steps.index(k) for k in b.steps])
            for b in bands
        ]
        """Rows, their weights, and which of the pictures they are exposed in."""
        slow = config.auto_gain
        self._brightness = config.brightness
        self._share = None if slow is None else 1 - exp(-1 / config.rate / slow)
        self._gain = 1.0
        self._level: float | None = None
        self._noise = None
        if config.noise > 0:
            tile = (config.height + NOISE_MARGIN, config.width + NOISE_MARGIN, 3)
            self._noise = rng.normal(0.0, config.noise, tile).astype(np.float32)

    def develop(self, pictures: list[Image], gain: float) -> Image:
        """Return the frame, RGB, uint8 (H, W, 3), read-only, that the sensor makes of the pictures
        (h, w, 3) rendered in one frame interval, in order of time. `gain` is a factor on their
        brightness, which is multiplied by the brightness in the camera's settings. If the settings
        have an automatic gain, it is applied last, to the noise too, and adapted for the next
        frame.

        The first frame of a run has one picture only. The lens distorts the mean of the pictures,
        which is the same as to distort each of them.
        """
        gain *= self._brightness
        fixed = gain == 1.0 and self._noise is None and self._share is None
        if len(pictures) == 1 and fixed:
            image = self._lens.bend(pictures[0])
        else:
            light = self._exposed(pictures) * np.float32(gain)
            if self._noise is not None:
                top, left = self._rng.integers(0, NOISE_MARGIN, 2)
                light += self._noise[top : top + self._size[0], left : left + self._size[1]]
            if self._share is not None:
                light *= np.float32(self._gain)
            image = np.clip(np.rint(light), 0, 255).astype(np.uint8)
            if self._share is not None:
                self._adapt(max(float(image.mean()), 1.0), self._share)
        image.setflags(write=False)
        return image

    def _exposed(self, pictures: list[Image]) -> np.ndarray:
        """Return the light (H, W, 3) of a frame, distorted by the lens, in grey levels: each row is
        the mean of the pictures in its own exposure.
        """
        if len(pictures) == 1 or len(self._bands) <= 1:
            return self._lens.bend(_mean(pictures))
        light = np.zeros((*self._size, 3), np.float32)
        for rows, weights, taken in self._bands:
            mean = _mean([pictures[i] for i in taken])
            light[rows] += weights * self._lens.bend(mean, rows)
        return light

    def _adapt(self, level: float, share: float) -> None:
        """Move the automatic gain, on a logarithmic scale, by a share, 0 to 1, of the way to the
        value at which the newest picture, whose mean grey level is `level`, would have that of the
        run's first picture. The gain stays from 1/8 to 8.
        """
        if self._level is None:
            self._level = level
        self._gain = float(np.clip(self._gain * (self._level / level) ** share, *GAINS))


def _mean(pictures: Sequence[Image]) -> NDArray[np.float32]:
    return np.asarray(np.mean(pictures, axis=0, dtype=np.float32))
