"""Renderer whose pictures are parts of recorded ones: those of a camera that turns about the centre
of the recording camera.
"""

from concurrent.futures import ThreadPoolExecutor
from math import ceil
from typing import final

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera.renderer import DepthPromise, Promise, camera_pose
from sim.recording.recorded import EYE, Recorded, Shown
from sim.types import Array, Camera, Image

CELL = 8
"""If the recording camera's lens distorts, the places of pixels this far apart [px] are computed
exactly, and those between them by bilinear interpolation; the error is a hundredth of a pixel."""
MIDDLE = 0.5
"""A pixel's middle from its corner [px]; OpenCV counts from the middle of the first pixel."""


@final
class RecordingRenderer:
    """A renderer, with the methods of `sim.camera.renderer.Renderer`, that cuts its pictures out of
    those of a recording: they show what a camera sees that turns about the centre of the recording
    camera.

    A thread reads, decodes and warps the recorded pictures; it reads the next picture ahead.
    """

    def __init__(
        self, recorded: Recorded, model: mujoco.MjModel, camera: str, view: Camera
    ) -> None:
        """Prepare the warps from the recording to a pinhole view.

        Args:
            recorded: The recording.
            model: The model of the scene.
            camera: Name of the turning camera in the model.
            view: Intrinsics of the turning camera, without distortion.
        """
        self._recorded = recorded
        self._camera = model.camera(camera).id
        self._view = view
        self._shrunk = max(1, int(recorded.camera.focal / view.focal))
        self._reader = ThreadPoolExecutor(1, "recording")
        self._shown: Shown = iter(())
        height, width = recorded.camera.height, recorded.camera.width
        self._black = self._reduced(np.zeros((height, width, 3), np.uint8))
        """The first picture, if that of the recording cannot be decoded."""
        self._latest = -1
        """Number of the last picture that was read; -1: none was."""
        self._pictures: dict[int, Image] = {}
        """The last two pictures that were read, by their numbers."""
        u, v = np.meshgrid(_nodes(view.width), _nodes(view.height))
        self._rays = view.normalise(np.stack([u, v], axis=-1))
        """Normalised coordinates X/Z, Y/Z (rows, columns, 2), in the turning camera's frame, of
        places in its picture that are `CELL` px apart, with one more at each side."""

    def close(self) -> None:
        """End the thread that reads the pictures, after the picture that it is working on."""
        self._reader.shutdown(wait=True, cancel_futures=True)
        self._shown = iter(())

    def begin(self, data: mujoco.MjData) -> Promise:
        """Begin the picture at the time and with the camera's orientation in MuJoCo's state `data`,
        which may change afterwards. Return a function that waits for the picture, RGB, uint8 (H, W,
        3), and returns it.
        """
        number = self._recorded.index(data.time)
        turn = EYE.rotation.T @ camera_pose(data, self._camera).rotation
        begun = self._reader.submit(self._warped, number, turn)
        self._reader.submit(self._read, number + 1)
        return begun.result

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        """Return a mask (H, W) that is the same everywhere: false if `alone` is False and the
        recording does not show the target at the time of `data`, else true. The target's visible
        fraction is then 1, or 0 where it is absent. `geoms` is not used.
        """
        is_seen = alone or bool(self._recorded.present[self._recorded.index(data.time)])
        return np.full((self._view.height, self._view.width), is_seen)

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        """Return a function whose result is a depth picture (H, W), float32, in which all depths
        are infinite, because a recording has none. `data` is not used.
        """
        return lambda: np.full((self._view.height, self._view.width), np.inf, np.float32)

    def _read(self, number: int) -> None:
        """Read on to the picture with a number, or to the last one; for an earlier picture that is
        not kept, start again from the first. A picture that cannot be decoded is replaced by the
        one before it, the first one by a black one.
        """
        if self._latest < 0 or number < self._latest - 1:
            self._shown = self._recorded.pictures()
            self._latest = -1
        while self._latest < min(number, len(self._recorded.times) - 1):
            _, image = next(self._shown, (0.0, None))
            before = self._pictures.get(self._latest, self._black)
            self._latest += 1
            self._pictures[self._latest] = before if image is None else self._reduced(image)
            self._pictures.pop(self._latest - 2, None)

    def _reduced(self, image: Image) -> Image:
        """Return a recorded picture in which blocks of `_shrunk` x `_shrunk` pixels are replaced by
        their means. A block is as large as fits into a pixel of the view: otherwise the view would
        skip pixels, and edges would flicker.
        """
        times = self._shrunk
        if times == 1:
            return image
        height, width = image.shape[0] // times, image.shape[1] // times
        whole = image[: height * times, : width * times]
        return cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)  # type: ignore[return-value]

    def _warped(self, number: int, turn: Array) -> Image:
        """Return the picture, RGB (H, W, 3), that the turning camera sees in the recorded picture
        with a number; `turn` (3, 3) is its rotation R_recording_turned.
        """
        self._read(number)
        picture = self._pictures[number]
        if self._recorded.camera.distortion is not None:
            u, v = self._maps(turn)
            return cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[return-value]
        to_rays = np.linalg.inv(_matrix(self._view, 1))
        seen_at = _matrix(self._recorded.camera, self._shrunk) @ turn @ to_rays
        return cv2.warpPerspective(  # type: ignore[return-value]
            picture,
            seen_at,
            (self._view.width, self._view.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )

    def _maps(self, turn: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return for each pixel of the view its u and its v (H, W) [px] in the recorded picture,
        shrunk as by `_reduced` and distorted by the recording camera's lens; they are counted from
        the middle of the first pixel, as in OpenCV.
        """
        places = seen_from(self._recorded.camera, turn, self._rays) / self._shrunk - MIDDLE
        rows, columns = places.shape[:2]
        size = columns * CELL, rows * CELL
        inside = np.s_[CELL : CELL + self._view.height, CELL : CELL + self._view.width]
        u, v = (
            np.asarray(cv2.resize(places[..., i].astype(np.float32), size)[inside], np.float32)
            for i in (0, 1)
        )
        return u, v


def seen_from(recording: Camera, turn: Array, rays: Array) -> Array:
    """Return the pixels (..., 2) [px] at which a recording shows what a turned camera, with the
    same centre as the recording camera, sees along its rays; nan for rays behind the recording
    camera.

    Args:
        recording: Intrinsics of the recording camera.
        turn: Rotation R_recording_turned (3, 3): it takes directions in the turned camera's frame
            to the recording camera's.
        rays: Normalised coordinates X/Z, Y/Z (..., 2) in the turned camera's frame.
    """
    x, y, z = np.moveaxis(rays @ turn[:, :2].T + turn[:, 2], -1, 0)
    ahead = np.where(z > 0, z, np.nan)
    return recording.to_pixels(np.stack([x / ahead, y / ahead], axis=-1))


def _matrix(camera: Camera, shrunk: int) -> Array:
    """Return the intrinsic matrix (3, 3) [px] of a camera whose picture is shrunk to 1 / `shrunk`
    of its size, with pixels counted from the middle of the first one, as in OpenCV.
    """
    cx = camera.cx / shrunk - MIDDLE
    cy = camera.cy / shrunk - MIDDLE
    return np.array([[camera.fx / shrunk, 0, cx], [0, camera.fy / shrunk, cy], [0, 0, 1.0]])


def _nodes(size: int) -> Array:
    """Return the middles [px] of blocks of `CELL` pixels that cover a side of the view, with one
    more block at each end, as `cv2.resize` spreads values over blocks.
    """
    return CELL * (np.arange(-1.0, ceil(size / CELL) + 1) + 0.5)
