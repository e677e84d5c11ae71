"""Films: a title, pictures beside each other, and below them a chart that grows with time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from sim.types import Array, Image
from tracking.drawing.colours import PARTICLES, STATUS_ON_WHITE
from tracking.drawing.contact_sheet import outline
from tracking.drawing.figures import DOTS, literal
from tracking.drawing.running_chart import Chart, RunningChart
from tracking.drawing.video_writer import VideoWriter

MARGIN = 16
"""Space around the pictures [px]."""
HEAD = 40
"""Height of the title's line [px]."""
CAPTION = 24
"""Height of the captions [px]."""
CHART = 194
"""Height of the chart [px]."""
LETTER = 12
"""Width of a letter of the title [px]; a longer title is cut."""
OTHERS = 410
"""Width of the texts beside the title [px]."""
STATUS = 100
"""Width of the status among these [px]."""
LEFT = 70
"""Space left of the chart's axes [px]."""
BELOW = 50
"""Space below the chart's axes [px]."""
ABOVE = 32
"""Space above the chart's axes, for the legend [px]."""
GROUND = (228, 228, 228)
"""Colour around a picture in its panel (RGB)."""
LINE = 2
"""Width of an outline [px]."""
DOT = 1
"""Radius of a particle [px]."""
FRONT = 0.5
"""Beginning of the line to the target's front, as a share of the distance from the centre."""
Marks = Sequence[tuple[Array, tuple[int, int, int]]]
"""Points (n, 2) [px] of outlines or lines, each with its colour (RGB)."""


def panel(
    image: Image | None,
    width: int,
    height: int,
    marks: Marks = (),
    particles: Array | None = None,
    paths: Marks = (),
) -> Image:
    """Return a panel (height, width, 3) with a picture in its middle; black without a picture.

    Args:
        image: RGB of any size.
        width: Width of the panel [px].
        height: Height of the panel [px].
        marks: Corners (4, 2) of outlines, in pixels of the picture.
        particles: Positions (n, 2 or more) of dots, in pixels of the picture.
        paths: Points (n, 2) of lines, in pixels of the picture.
    """
    if image is None:
        return np.zeros((height, width, 3), np.uint8)
    factor = min(width / image.shape[1], height / image.shape[0])
    size = round(factor * image.shape[1]), round(factor * image.shape[0])
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    drawn = cv2.resize(image, (max(size[0], 1), max(size[1], 1)), interpolation=method).astype(
        np.uint8
    )
    for x, y in () if particles is None else (factor * particles[:, :2]).round().tolist():
        if 0 <= x < size[0] and 0 <= y < size[1]:
            cv2.circle(drawn, (int(x), int(y)), DOT, PARTICLES, -1, cv2.LINE_AA)
    for points, colour in paths:
        outline(drawn, points, colour, factor, closed=False)
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


class Pages(Protocol):
    """Receiver of the frames of a film that is not written to a file."""

    def add(self, image: Image, time: float, /) -> None:
        """Take a frame (height, width, 3) that is shown from a time on [s]."""

    def close(self) -> None:
        """Take no more."""

    def abandon(self) -> None:
        """Take no more after an error."""


class FilmPage:
    """Writer of a film."""

    def __init__(
        self,
        to: Path | Pages,
        rate: float,
        title: str,
        captions: Sequence[str],
        size: tuple[int, int],
        chart: Chart,
    ) -> None:
        """Open the file.

        Args:
            to: The file to write, or the receiver of the frames.
            rate: Approximate rate of the frames [1/s].
            title: Title of the film.
            captions: Captions of the panels.
            size: Width and height of each panel [px], even numbers.
            chart: The chart below the panels.

        Raises:
            OSError: The file cannot be written.
        """
        width = MARGIN + len(captions) * (size[0] + MARGIN)
        height = HEAD + CAPTION + size[1] + CHART
        longest = (width - OTHERS) // LETTER
        if len(title) > longest:
            title = f"{title[: longest - 3]}..."
        figure = Figure((width / DOTS, height / DOTS), dpi=DOTS)

        def written(x: float, y: float, text: str = "", **style: Any) -> Text:
            return figure.text(x / width, 1 - y / height, text, va="center", **style)

        written(MARGIN, HEAD / 2, literal(title), size=10, weight="bold")
        for i, caption in enumerate(captions):
            written(MARGIN + i * (size[0] + MARGIN), HEAD + CAPTION / 2, caption, size=8)
        right = width - MARGIN
        self._note = written(right - STATUS, HEAD / 2, size=10, ha="right", animated=True)
        self._status = written(right, HEAD / 2, size=10, ha="right", weight="bold", animated=True)
        self._badges = [
            written(
                (i + 1) * (size[0] + MARGIN),
                HEAD + CAPTION / 2,
                size=8,
                ha="right",
                weight="bold",
                animated=True,
            )
            for i in range(len(captions))
        ]
        """Statuses above the pictures, where each has its own."""
        axes = figure.add_axes(
            (LEFT / width, BELOW / height, (right - LEFT) / width, (CHART - BELOW - ABOVE) / height)
        )
        self._chart = RunningChart(axes, chart)
        self._panel = size
        self._figure = figure
        self._canvas = FigureCanvasAgg(figure)
        self._ground: Any = None
        self._video = VideoWriter(to, rate, width, height) if isinstance(to, Path) else to
        self.close = self._video.close
        """Finish the file."""
        self.abandon = self._video.abandon
        """Close the file early; it can be played up to its last whole second."""

    def add(
        self,
        time: float,
        panels: Sequence[Image],
        values: Sequence[float],
        statuses: Sequence[str],
        note: str,
    ) -> None:
        """Write a frame.

        Args:
            time: Time of the frame [s].
            panels: A picture of the panel's size for each caption.
            values: A value for each curve.
            statuses: LOCKED, UNSURE or LOST: one for the film, or one for each panel.
            note: Text before the time.

        Raises:
            OSError: The file cannot be written.
        """
        self._note.set_text(f"{note}    t = {time:.2f} s")
        badges = [self._status] if len(statuses) == 1 else self._badges
        for badge, status in zip(badges, statuses, strict=True):
            badge.set(text=status, color=STATUS_ON_WHITE[status])
        if self._chart.add(time, values, statuses) or self._ground is None:
            self._canvas.draw()
            self._ground = self._canvas.copy_from_bbox(self._figure.bbox)
        self._canvas.restore_region(self._ground)
        for artist in (self._note, *badges, *self._chart.artists):
            self._figure.draw_artist(artist)
        page = np.asarray(self._canvas.buffer_rgba())[..., :3].copy()
        top = HEAD + CAPTION
        for i, picture in enumerate(panels):
            left = MARGIN + i * (self._panel[0] + MARGIN)
            page[top : top + self._panel[1], left : left + self._panel[0]] = picture
        self._video.add(page, time)
