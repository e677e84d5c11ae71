"""An annotated video (MP4): truth white; estimate green, amber or red by the tracker's status.

The file is written in fragments that can be played by themselves, so that a video is playable even
if the program is killed.
"""

from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from sim.types import Array, Image
from tracking.evaluation.drawing.contact_sheet import TRUE, outline
from tracking.evaluation.track import Shot
from tracking.types import Region, Status

COLOURS = {
    Status.LOCKED: (60, 220, 60),
    Status.UNSURE: (255, 180, 30),
    Status.LOST: (240, 50, 50),
}
CODEC, FORMAT = "mpeg4", "yuv420p"
FRAGMENTED = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
FRAGMENT = 12
"""Most frames in a fragment; a killed program loses at most the last fragment."""
COARSEST = 4
"""Largest quantiser of MPEG-4, 1 to 31; a small one keeps thin lines and numbers sharp."""
LARGEST_DENOMINATOR = 65_535
"""Largest denominator of a rate in MPEG-4."""


class AnnotatedVideo:
    """Writer of one video; all pictures are resized to the size of the first."""

    def __init__(self, path: Path, rate: float, region: Region) -> None:
        """Open the file.

        Raises:
            OSError: The file cannot be written.
        """
        self._region = region
        self._rate = Fraction(rate).limit_denominator(LARGEST_DENOMINATOR)
        self._stream: av.VideoStream | None = None
        self._size = (0, 0)
        # FFmpeg gets an open file, because it accepts only names in UTF-8.
        self._file = path.open("wb", buffering=0)
        self._container = av.open(self._file, mode="w", format="mp4", options=FRAGMENTED)

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a picture.

        Raises:
            OSError: The file cannot be written.
        """
        status = shot.estimate.status
        if shot.picture.image is None:
            image = np.zeros((self._size[1], self._size[0], 3), np.uint8)
        else:
            image = shot.picture.image.copy()
        if truth is not None:
            outline(image, truth, TRUE)
        outline(image, shot.estimate.outline(self._region), COLOURS[status])
        cv2.putText(image, f"{shot.index} {status.name}", (5, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4,
                    COLOURS[status], 1, cv2.LINE_AA)  # fmt: skip
        self._write(image)

    def close(self) -> None:
        """Finish the file."""
        with self._file:
            if self._stream is not None:
                self._container.mux(self._stream.encode(None))
            self._container.close()

    def abandon(self) -> None:
        """Close the file as it is; it can be played up to here."""
        self._file.close()

    def _write(self, image: Image) -> None:
        stream = self._opened(image.shape[1], image.shape[0])
        if image.shape[1::-1] != self._size:
            image = cv2.resize(image, self._size).astype(np.uint8)
        self._container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))

    def _opened(self, width: int, height: int) -> av.VideoStream:
        if self._stream is None:
            self._size = (width, height)
            stream = self._container.add_stream(CODEC, rate=self._rate)
            stream.width, stream.height, stream.pix_fmt = width, height, FORMAT
            stream.codec_context.qmax = COARSEST
            stream.codec_context.gop_size = FRAGMENT
            self._stream = stream
        return self._stream
