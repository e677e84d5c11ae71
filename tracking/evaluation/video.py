"""An annotated video (MP4): truth white, estimate green, amber or red as the tracker is sure."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from sim.types import Array
from tracking.evaluation.contact_sheet import TRUE, outline
from tracking.evaluation.track import Shot
from tracking.types import Region, Status

COLOURS = {
    Status.LOCKED: (60, 220, 60),
    Status.UNSURE: (255, 180, 30),
    Status.LOST: (240, 50, 50),
}


class Video:
    """Writes one video; pictures of another size than the first are fitted into it."""

    def __init__(self, path: Path, rate: float, region: Region) -> None:
        self._path, self._rate, self._region = path, rate, region
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a picture.

        Raises:
            ValueError: OpenCV cannot write videos here.
        """
        status = shot.estimate.status
        if shot.picture.image is None:
            image = np.zeros((self._size[1], self._size[0], 3), np.uint8)
        else:
            image = shot.picture.image.copy()
        if truth is not None:
            outline(image, truth, TRUE)
        outline(image, self._region.corners(shot.estimate.state), COLOURS[status])
        cv2.putText(image, f"{shot.index} {status.name}", (5, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4,
                    COLOURS[status], 1, cv2.LINE_AA)  # fmt: skip
        self._open(image.shape[1], image.shape[0]).write(
            cv2.cvtColor(cv2.resize(image, self._size), cv2.COLOR_RGB2BGR)
        )

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.release()

    def _open(self, width: int, height: int) -> cv2.VideoWriter:
        if self._writer is None:
            self._size = (width, height)
            code = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), code, self._rate, self._size)
            if not self._writer.isOpened():
                raise ValueError(f"{self._path}: OpenCV cannot write this video")
        return self._writer
