"""A film: a line of text, pictures beside each other, and below them a chart that grows."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from sim.types import Array, Image
from tracking.drawing.colours import PARTICLES, STATUS_ON_WHITE
from tracking.drawing.contact_sheet import outline
from tracking.drawing.figures import DOTS, literal
from tracking.drawing.running_chart import Chart, RunningChart, pixels
from tracking.drawing.video_writer import VideoWriter

MARGIN = 16
HEAD = 40
CAPTION = 24
CHART = 194
"""Space around the pictures; heights of the line of text, of the captions, of the chart [px]."""
LETTER = 12
OTHERS = 410
STATUS = 100
"""Widths of a letter of the title, of all that stands beside it, and of the status in there [px]; a
longer title is cut."""
GROUND = (228, 228, 228)
LINE = 2
DOT = 1
"""Width of an outline, and radius of a particle [px]."""
FRONT = 0.5
"""Length of the line that shows the front, from the centre: the last share of the way."""
Marks = Sequence[tuple[Array, tuple[int, int, int]]]


def panel(
    image: Image | None, width: int, height: int, marks: Marks = (), particles: Array | None = None
) -> Image:
    """A picture in the middle of a panel (height, width, 3), black where there is none.

    Args:
        image: RGB of any size.
        width: Of the panel [px].
        height: Of the panel [px].
        marks: Corners (4, 2) [px] of the picture to draw into it, each with its colour.
        particles: Places (n, 2 or more) [px] to draw as dots.
    """
    if image is None:
        return np.zeros((height, width, 3), np.uint8)
    factor = min(width / image.shape[1], height / image.shape[0])
    size = round(factor * image.shape[1]), round(factor * image.shape[0])
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    drawn = cv2.resize(image, (max(size[0], 1), max(size[1], 1)), interpolation=way).astype(
        np.uint8
    )
    for x, y in () if particles is None else (factor * particles[:, :2]).round().tolist():
        if 0 <= x < size[0] and 0 <= y < size[1]:
            cv2.circle(drawn, (int(x), int(y)), DOT, PARTICLES, -1, cv2.LINE_AA)
    for corners, colour in marks:
        centre = corners.mean(axis=0)
        front = (corners[1] + corners[2]) / 2
        outline(drawn, np.stack([centre + FRONT * (front - centre), front]), colour, factor, LINE)
        outline(drawn, corners, colour, factor, LINE)
    whole = np.full((height, width, 3), GROUND, np.uint8)
    top = (height - drawn.shape[0]) // 2
    left = (width - drawn.shape[1]) // 2
    whole[top : top + drawn.shape[0], left : left + drawn.shape[1]] = drawn
    return whole


class FilmPage:
    """Writer of one film."""

    def __init__(
        self,
        path: Path,
        rate: float,
        title: str,
        captions: Sequence[str],
        size: tuple[int, int],
        chart: Chart,
    ) -> None:
        """Open the file.

        Args:
            path: The file to write.
            rate: About how many frames come in a second [1/s].
            title: What the film shows.
            captions: One above each panel.
            size: Even width and height of each panel [px].
            chart: What grows below them.

        Raises:
            OSError: The file cannot be written.
        """
        count = len(captions)
        width = MARGIN + count * (size[0] + MARGIN)
        height = HEAD + CAPTION + size[1] + CHART
        longest = (width - OTHERS) // LETTER
        if len(title) > longest:
            title = f"{title[: longest - 3]}..."
        self._panel = size
        self._page = np.full((height, width, 3), 255, np.uint8)
        head, (name,) = _texts(width, HEAD, 1)
        name.set(x=MARGIN / width, ha="left", text=literal(title), weight="bold")
        self._page[:HEAD] = pixels(head)
        self._beside, (self._note, self._status) = _texts(OTHERS, HEAD, 2)
        self._note.set(x=1 - (MARGIN + STATUS) / OTHERS, ha="right")
        self._status.set(x=1 - MARGIN / OTHERS, ha="right", weight="bold")
        line, texts = _texts(width, CAPTION, count)
        for i, (text, caption) in enumerate(zip(texts, captions, strict=True)):
            text.set(x=(MARGIN + i * (size[0] + MARGIN)) / width, ha="left", text=caption, size=8)
        self._page[HEAD : HEAD + CAPTION] = pixels(line)
        self._chart = RunningChart(width, CHART, chart)
        self._video = VideoWriter(path, rate, width, height)

    def add(
        self, time: float, panels: Sequence[Image], values: Sequence[float], status: str, note: str
    ) -> None:
        """Write a frame.

        Args:
            time: When it is shown [s].
            panels: One for each caption, of the panel's size.
            values: One for each curve.
            status: LOCKED, UNSURE or LOST.
            note: More about the frame.

        Raises:
            OSError: The file cannot be written.
        """
        self._note.set_text(f"{note}    t = {time:.2f} s")
        self._status.set(text=status, color=STATUS_ON_WHITE[status])
        self._page[:HEAD, -OTHERS:] = pixels(self._beside)
        top = HEAD + CAPTION
        for i, picture in enumerate(panels):
            left = MARGIN + i * (self._panel[0] + MARGIN)
            self._page[top : top + self._panel[1], left : left + self._panel[0]] = picture
        self._page[-CHART:] = self._chart.add(time, values, status)
        self._video.add(self._page, time)

    def close(self) -> None:
        """Finish the file."""
        self._video.close()

    def abandon(self) -> None:
        """Close the file as it is; it can be played up to here."""
        self._video.abandon()


def _texts(width: int, height: int, count: int) -> tuple[Figure, list[Text]]:
    """A figure of a size [px] that is one line of texts."""
    figure = Figure((width / DOTS, height / DOTS), dpi=DOTS)
    return figure, [figure.text(0, 0.5, "", va="center", size=10) for _ in range(count)]
