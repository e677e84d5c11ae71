"""Film of a track: truth white; estimate green, amber or red by the tracker's status."""

from pathlib import Path

from sim.types import Array
from tracking.drawing import colours
from tracking.drawing.film_page import FilmPage, Pages, panel
from tracking.drawing.running_chart import Chart
from tracking.evaluation.track import Shot
from tracking.types import Region

CAPTION = "estimate green (locked), amber (unsure), red (lost); truth white"
CURVES = {"confidence": colours.CURVES[1]}
SMALLEST = (608, 64)
"""Least width and height of a panel [px]; smaller pictures are enlarged."""
LARGEST = (1888, 1000)
"""Largest width and height of a panel [px]; larger pictures are reduced."""


class AnnotatedVideo:
    """Writer of a film; its size follows from that of the first picture."""

    def __init__(
        self, to: Path | Pages, rate: float, region: Region, title: str, end: float | None = None
    ) -> None:
        """Prepare a film; the file is opened with the first picture.

        Args:
            to: The file to write, or the receiver of the frames.
            rate: Approximate rate of the pictures [1/s].
            region: The target's region.
            title: Title of the film.
            end: Time of the last picture [s]; None: unknown.
        """
        self._to = to
        self._rate = rate
        self._region = region
        self._title = title
        self._end = end
        self._size = (0, 0)
        self._film: FilmPage | None = None

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a picture with its estimate, and the true corners (4, 2) [px] if they are known.

        Raises:
            OSError: The file cannot be written.
        """
        marks = [(shot.estimate.outline(self._region), colours.STATUS[shot.estimate.status])]
        if truth is not None:
            marks.insert(0, (truth, colours.TRUTH))
        film = self._opened(*(shot.size or SMALLEST))
        view = panel(shot.picture.image, *self._size, marks, shot.estimate.particles)
        note = f"frame {shot.index}"
        film.add(shot.picture.time, [view], [shot.confidence], [shot.estimate.status.name], note)

    def close(self) -> None:
        """Finish the file."""
        if self._film:
            self._film.close()

    def abandon(self) -> None:
        """Close the file early; it can be played up to its last whole second."""
        if self._film:
            self._film.abandon()

    def _opened(self, width: int, height: int) -> FilmPage:
        if self._film is None:
            factor = max(SMALLEST[0] / width, 1.0)
            factor = min(factor, LARGEST[0] / width, LARGEST[1] / height)
            w = max(SMALLEST[0], round(factor * width))
            h = max(SMALLEST[1], round(factor * height))
            self._size = w + w % 2, h + h % 2
            chart = Chart(CURVES, "confidence", self._end, top=1.0)
            self._film = FilmPage(self._to, self._rate, self._title, [CAPTION], self._size, chart)
        return self._film
