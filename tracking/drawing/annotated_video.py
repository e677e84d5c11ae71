"""Film of a tracker's estimates: each picture with the estimated and the true outline, and a chart
below it.
"""

from functools import partial
from pathlib import Path

from sim.types import Array
from tracking.drawing import colours
from tracking.drawing.film_page import FilmPage, FrameReceiver, panel
from tracking.drawing.running_chart import Chart
from tracking.evaluation.track import Shot
from tracking.types import Region

CAPTION = "estimate green (locked), amber (unsure), red (lost); truth white"
CURVES = {"confidence": colours.CURVES[1]}
SMALLEST = (608, 64)
"""Least width and height of the panel with the picture [px]; a narrower picture is enlarged to this
width, unless it would then be higher than `LARGEST`."""
LARGEST = (1888, 1000)
"""Largest width and height of a picture in the film [px]; larger pictures are reduced."""


class AnnotatedVideo:
    """Writer of a film of a tracker's estimates: pictures with estimated and true outlines and the
    tracker's particles, and a chart of the confidence. The size of the first picture decides that
    of the film. `to` is its MP4 file or a receiver of its frames, `rate` the approximate rate of
    the pictures [1/s], `region` the size of the target in the first picture [px], and `end` the
    time of the last picture [s], None if unknown.
    """

    def __init__(
        self,
        to: Path | FrameReceiver,
        rate: float,
        region: Region,
        title: str,
        end: float | None = None,
    ) -> None:
        """Store the settings of a film; the file is opened with the first picture.

        Args:
            to: The MP4 file to write, or the receiver of the frames.
            rate: Approximate rate of the pictures [1/s].
            region: Size of the target in the first picture [px].
            title: Title of the film.
            end: Time of the last picture [s]; None: unknown.
        """
        chart = Chart(CURVES, "confidence", end, top=1.0)
        self._open = partial(FilmPage, to, rate, title, [CAPTION], chart=chart)
        self._region = region
        self._film: FilmPage | None = None

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a frame of the film: a picture with the estimated and the true outline and the
        tracker's particles, and the chart of the confidence up to the picture's time.

        Args:
            shot: The picture and the tracker's estimate for it.
            truth: True corners (4, 2) [px] in that picture; nan: the target is absent; None:
                unknown.

        Raises:
            OSError: The file cannot be written.
        """
        marks = [(shot.estimate.outline(self._region), colours.STATUS[shot.estimate.status])]
        if truth is not None:
            marks.insert(0, (truth, colours.TRUTH))
        film = self._film = self._film or self._open(size=_panel_for(*(shot.size or SMALLEST)))
        view = panel(shot.picture.image, *film.size, marks, shot.estimate.particles)
        note = f"frame {shot.index}"
        film.add(shot.picture.time, [view], [shot.confidence], [shot.estimate.status.name], note)

    def close(self) -> None:
        """Finish the film's file; do nothing if no picture was written."""
        if self._film:
            self._film.close()

    def abandon(self) -> None:
        """Close the film's file after an error; it keeps the frames that it has whole, and is
        removed if it has none. Do nothing if no picture was written.
        """
        if self._film:
            self._film.abandon()


def _panel_for(width: int, height: int) -> tuple[int, int]:
    """Return width and height [px], even numbers, of the panel for pictures of a size [px]."""
    factor = max(SMALLEST[0] / width, 1.0)
    factor = min(factor, LARGEST[0] / width, LARGEST[1] / height)
    w = max(SMALLEST[0], round(factor * width))
    h = max(SMALLEST[1], round(factor * height))
    return w + w % 2, h + h % 2
