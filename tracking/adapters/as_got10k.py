"""Our trackers in the convention of the GOT-10k toolkit (Huang, Zhao, Huang 2021)."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.files.picture_file import read_image
from sim.types import Array, Image
from tracking.adapters.follower import Follower
from tracking.sequences.sources import RATE


class Got10kTracker:
    """A tracker for the toolkit's experiments: a name, `track(img_files, box)`, and its methods
    `init(image, box)` and `update(image) -> box`.

    Pictures are RGB, of PIL or arrays; boxes are of OTB's kind (pixels counted from 1).
    """

    is_deterministic = True

    def __init__(self, kind: str, seed: int = 0, rate: float = RATE, **settings: Any) -> None:
        """Choose a tracker by its kind; see `tracking.create`."""
        self.name = kind
        self._follower = Follower(kind, seed, rate, settings)

    def init(self, image: Any, box: Any) -> None:
        """Learn the target.

        Raises:
            ValueError: The box is empty, or most of it is outside the picture.
        """
        self._follower.start(_array(image), np.array(box, dtype=float) - (1, 1, 0, 0))

    def update(self, image: Any) -> Array:
        """Return the box (4,)."""
        _, (left, top, width, height) = self._follower.update(_array(image))
        return np.array([left + 1.0, top + 1.0, width, height])

    def track(
        self,
        img_files: Sequence[str],
        box: Any,
        visualize: bool = False,  # noqa: ARG002 (the toolkit gives it)
    ) -> tuple[Array, Array]:
        """Follow a target through picture files.

        Args:
            img_files: Their paths.
            box: The target in the first one.
            visualize: Nothing is shown; `servobench track --video` draws.

        Returns:
            Boxes (n, 4), and the time that each picture took (n,) [s].

        Raises:
            ValueError: As for `init`, or a picture cannot be read.
        """
        found = np.zeros((len(img_files), 4))
        seconds = np.zeros(len(img_files))
        for i, file in enumerate(img_files):
            image = read_image(Path(file))
            began = time.perf_counter()
            if i == 0:
                self.init(image, box)
                found[0] = box
            else:
                found[i] = self.update(image)
            seconds[i] = time.perf_counter() - began
        return found, seconds


def _array(image: Any) -> Image:
    return np.ascontiguousarray(np.asarray(image, dtype=np.uint8))
