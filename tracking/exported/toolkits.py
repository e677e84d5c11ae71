"""Our trackers with the interfaces of OpenCV, of the GOT-10k toolkit (Huang, Zhao, Huang 2021) and
of the VOT toolkit's Python integration.
"""

import inspect
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from sim.files.bit_depth import BitDepth
from sim.files.picture_file import read_image, rgb
from sim.kinds import PartConfig
from sim.types import Array, Frame, Image
from tracking import configured
from tracking.sequences.quadrilateral import boxes, corners_of, placement
from tracking.sequences.sources import RATE
from tracking.types import Estimate, Status, Tracker

SIDES = 4
"""Number of points of a polygon that is a region."""

Rect = tuple[float, float, float, float]
"""Left, top, width, height [px]."""


class Follower:
    """Runs one of our trackers on pictures that have no times: they are assumed to come at a fixed
    `rate` [1/s]. `config` has the tracker's settings, `seed` is that of its random draws.
    """

    def __init__(self, config: PartConfig[Tracker], seed: int, rate: float) -> None:
        """Store the settings of a tracker; `start` makes it.

        Args:
            config: Settings of the tracker.
            seed: Seed of the tracker's random draws.
            rate: Rate of the pictures [1/s].
        """
        self._config = config
        self._seed = seed
        self._rate = rate

    def start(self, image: Image, numbers: ArrayLike, *, turned: bool = False) -> None:
        """Make a new tracker and start it on the first picture.

        Args:
            image: The first picture, RGB (H, W, 3).
            numbers: Box (4,) of left, top, width, height, or corners (8,) x1, y1 ... x4, y4 [px].
            turned: Keep the rotation of corners that form a rectangle; else use the upright box.

        Raises:
            ValueError: A side of the region is shorter than 4 px, most of it is outside the
                picture, or the tracker cannot use the picture.
        """
        self.region, state = placement(corners_of(np.array(numbers, dtype=float)), turned=turned)
        self._tracker = self._config.build(np.random.default_rng(self._seed))
        self._count = 0
        self._tracker.start(self._frame(image), self.region, state)

    def update(self, image: Image) -> tuple[Estimate, Rect]:
        """Return the estimate for the next picture, RGB (H, W, 3), and the upright box (left, top,
        width, height) [px] around the estimated corners, also where the target is not seen.
        """
        found = self._tracker.update(self._frame(image))
        left, top, width, height = boxes(found.outline(self.region)[None])[0].tolist()
        return found, (left, top, width, height)

    def _frame(self, image: Image) -> Frame:
        """Return a picture as the next frame; its time is its number divided by the rate [s]."""
        index = self._count
        self._count = self._count + 1
        return Frame(image, index / self._rate, index)


class OpenCVTracker:
    """One of our trackers, given as for `tracking.create`, with the interface of OpenCV's: BGR
    pictures, which come at `rate` [1/s], `init(image, rect)`, and `update(image)`, which returns
    (ok, rect).

    Example:
        >>> import numpy as np
        >>> image = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)
        >>> tracker = OpenCVTracker("mk_ssd")
        >>> tracker.init(image, (130, 105, 60, 30))
        >>> ok, (left, top, width, height) = tracker.update(image)
        >>> ok, round(left), round(top), round(width), round(height)
        (True, 130, 105, 60, 30)
    """

    def __init__(
        self,
        kind: str,
        seed: int = 0,
        rate: float = RATE,
        preset: str | None = None,
        **settings: object,
    ) -> None:
        """Store the kind and the settings of the tracker; `init` starts it.

        Args:
            kind: Kind of the tracker, such as "mk_ssd".
            seed: Seed of the tracker's random draws.
            rate: Rate of the pictures [1/s].
            preset: Name of one of the kind's presets, such as "paper" for the settings of the
                tracker's paper; None for the defaults, the best settings known.
            **settings: Settings of the tracker.

        Raises:
            ValueError: There is no such kind or preset, or a setting has a wrong value.
            TypeError: The tracker has no such setting.
        """
        self._follower = Follower(configured(kind, preset, **settings), seed, rate)

    def init(self, image: np.ndarray, rect: Rect) -> None:
        """Learn the target in a box (left, top, width, height) [px] of the first picture, BGR
        (H, W, 3).

        Raises:
            ValueError: A side of the box is shorter than 4 px, or most of it is outside the
                picture.
        """
        self._follower.start(rgb(image), rect)

    def update(self, image: np.ndarray) -> tuple[bool, Rect]:
        """Find the target in the next picture, BGR (H, W, 3), and return its box, as OpenCV's
        trackers do.

        Returns:
            True if the target is seen, and its upright box (left, top, width, height) [px]; where
            the target is not seen, False and the box of the tracker's prediction.
        """
        found, rect = self._follower.update(rgb(image))
        return found.status is Status.LOCKED, rect


class Got10kTracker:
    """One of our trackers, given as for `tracking.create`, with the interface of the GOT-10k
    toolkit: `init`, `update` and `track`.

    Pictures are RGB, as arrays or PIL images, and come at `rate` [1/s]; boxes are left, top, width,
    height [px], with pixels counted from 1.
    """

    is_deterministic = True

    def __init__(
        self,
        kind: str,
        seed: int = 0,
        rate: float = RATE,
        preset: str | None = None,
        **settings: object,
    ) -> None:
        """Store the kind and the settings of the tracker; `init` starts it.

        Args:
            kind: Kind of the tracker, such as "mk_ssd".
            seed: Seed of the tracker's random draws.
            rate: Rate of the pictures [1/s].
            preset: Name of one of the kind's presets, such as "paper" for the settings of the
                tracker's paper; None for the defaults, the best settings known.
            **settings: Settings of the tracker.

        Raises:
            ValueError: There is no such kind or preset, or a setting has a wrong value.
            TypeError: The tracker has no such setting.
        """
        self.name = kind
        self._follower = Follower(configured(kind, preset, **settings), seed, rate)

    def init(self, image: ArrayLike, box: ArrayLike) -> None:
        """Learn the target in a box (4,), left, top, width, height [px], with pixels counted from
        1, of the first picture, RGB.

        Raises:
            ValueError: A side of the box is shorter than 4 px, or most of it is outside the
                picture.
        """
        self._follower.start(_array(image), np.array(box, dtype=float) - (1, 1, 0, 0))

    def update(self, image: ArrayLike) -> Array:
        """Return the target's upright box (4,), left, top, width, height [px], with pixels counted
        from 1, in the next picture, RGB (H, W, 3); where the target is not seen, that of the
        tracker's prediction.
        """
        _, (left, top, width, height) = self._follower.update(_array(image))
        return np.array([left + 1.0, top + 1.0, width, height])

    def track(
        self,
        img_files: Sequence[str],
        box: ArrayLike,
        visualize: bool = False,  # the toolkit passes it
    ) -> tuple[Array, Array]:
        """Follow a target through n picture files.

        Args:
            img_files: Paths of the pictures.
            box: Box (4,) of the target in the first picture: left, top, width, height [px], with
                pixels counted from 1.
            visualize: Not used; `servobench track --video` writes a film.

        Returns:
            Upright boxes (n, 4) of the same form, of which the first is `box`, and the time that
            the tracker took for each picture (n,) [s].

        Raises:
            ValueError: A side of the box is shorter than 4 px, or most of it is outside the first
                picture; or a picture cannot be read.
        """
        found = np.zeros((len(img_files), 4))
        seconds = np.zeros(len(img_files))
        depth = BitDepth()
        for i, file in enumerate(img_files):
            image = read_image(Path(file), depth)
            began = time.perf_counter()
            if i == 0:
                self.init(image, box)
                found[0] = box
            else:
                found[i] = self.update(image)
            seconds[i] = time.perf_counter() - began
        return found, seconds


class VotHandle(Protocol):
    """Protocol of the object by which the VOT toolkit gives pictures and takes results: its methods
    are those of `vot.VOT("rectangle")` and `vot.VOT("polygon")`.
    """

    def region(self) -> Any:
        """Return the target's region in the first picture [px]: an object with x, y, width and
        height, or one with `points`.
        """

    def frame(self) -> str | None:
        """Return the path of the next picture; None or "" at the end."""

    def report(self, region: Any, confidence: float) -> None:
        """Send the toolkit the target's region [px] in the last picture, of the type of the first
        region, and the confidence 0..1, which is left out if the method takes none.
        """


def run_vot(
    handle: VotHandle,
    kind: str,
    seed: int = 0,
    rate: float = RATE,
    preset: str | None = None,
    **settings: object,
) -> None:
    """Follow a target for the VOT toolkit: take its pictures one after the other, and report a
    region for each but the first, until they end.

    Args:
        handle: The toolkit's object, such as `vot.VOT("rectangle")`.
        kind: Kind of the tracker; see `tracking.create`.
        seed: Seed of the tracker's random draws.
        rate: Rate of the pictures [1/s].
        preset: Name of one of the kind's presets, such as "paper" for the settings of the
            tracker's paper; None for the defaults, the best settings known.
        **settings: Settings of the tracker.

    Raises:
        ValueError: There is no such kind or preset, or a setting has a wrong value; a picture
            cannot be read or decoded, or is too large; or the region is a mask or a polygon without
            exactly four points, has a side shorter than 4 px, or is mostly outside the first
            picture.
        TypeError: The tracker has no such setting.
    """
    given = handle.region()
    path = handle.frame()
    if not path:
        return
    points = getattr(given, "points", None)
    is_mask = points is None and not hasattr(given, "width")
    if is_mask or (points is not None and len(points) != SIDES):
        found = "a mask" if points is None else f"a polygon of {len(points)} points"
        raise ValueError(
            f"the region is {found}: expected a rectangle or a polygon of {SIDES} points, as "
            "vot.VOT('rectangle') gives"
        )
    box = () if points else (given.x, given.y, given.width, given.height)
    follower = Follower(configured(kind, preset, **settings), seed, rate)
    scored = len(inspect.signature(handle.report).parameters) > 1
    region = np.array(points or box, dtype=float).ravel()
    depth = BitDepth()
    follower.start(read_image(Path(path), depth), region, turned=True)
    while path := handle.frame():
        found, rect = follower.update(read_image(Path(path), depth))
        if points is None:
            answer = type(given)(*rect)
        else:
            outline = found.outline(follower.region).tolist()
            answer = type(given)([type(points[0])(*corner) for corner in outline])
        handle.report(answer, *[1.0 - found.distance][: int(scored)])


def _array(image: ArrayLike) -> Image:
    """Return a picture, an array or PIL's, as an array (H, W, 3) of uint8."""
    return np.ascontiguousarray(np.asarray(image, dtype=np.uint8))
