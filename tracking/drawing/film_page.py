"""Films whose frames have a title, pictures beside each other, and a chart over time below them."""

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
"""Width of a letter of the title [px]; a title that does not fit is cut."""
OTHERS = 410
"""Width of the note, the time and the status beside the title [px]."""
STATUS = 100
"""Width of the status [px]."""
LEFT = 70
"""Space left of the chart's axes [px]."""
BELOW = 50
"""Space below the chart's axes [px]."""
ABOVE = 32
"""Space above the chart's axes, for the legend [px]."""
GROUND = (228, 228, 228)
"""Colour of a panel around its picture (RGB)."""
LINE = 2
"""Width of an outline [px]."""
DOT = 1
"""Radius of a particle [px]."""
FRONT = 0.5
"""The line from the target's centre to its front begins at this share of the distance."""
Marks = Sequence[tuple[Array, tuple[int, int, int]]]
"""Outlines or lines, each by its points (n, 2) [px] and its colour (RGB)."""


def panel(
    image: Image | None,
    width: int,
    height: int,
    marks: Marks = (),
    particles: Array | None = None,
    paths: Marks = (),
) -> Image:
    """Return a panel (height, width, 3), an image of a fixed size with a picture, scaled to fit, in
    its middle.

    Args:
        image: The picture, RGB of any size; None: a black panel.
        width: Width of the panel [px].
        height: Height of the panel [px].
        marks: Outlines to draw: pairs of corners (4, 2) in pixels of the picture, clockwise from
            the target's top left one, and colour (RGB). Each also gets a line to the middle of its
            right side, the target's front.
        particles: Dots to draw, by rows (n, 2 or more) that begin with x, y in pixels of the
            picture; None: no dots.
        paths: Open lines to draw: pairs of points (n, 2) in pixels of the picture and colour (RGB).
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


class FrameReceiver(Protocol):
    """Protocol of a receiver of the frames of a film, such as a live page, which takes the place of
    a file: `add` is called for each frame, then `close` or `abandon` once.
    """

    def add(self, image: Image, time: float, /) -> None:
        """Receive a frame, RGB (height, width, 3), that is shown from `time` [s] on."""

    def close(self) -> None:
        """Handle the end of the film after its last frame."""

    def abandon(self) -> None:
        """Handle the end of the film after an error."""


class FilmPage:
    """Writer of a film whose frames have a title, a picture area (panel) of the `size` (width,
    height) [px] below each of the captions, beside each other, and a chart over time below them.
    `to` is its MP4 file or a receiver of its frames, `rate` the approximate rate of the frames
    [1/s].
    """

    def __init__(
        self,
        to: Path | FrameReceiver,
        rate: float,
        title: str,
        captions: Sequence[str],
        size: tuple[int, int],
        chart: Chart,
    ) -> None:
        """Lay out the frames of a film, and open its file.

        Args:
            to: The MP4 file to write, or the receiver of the frames.
            rate: Approximate rate of the frames [1/s].
            title: Title of the film.
            captions: A caption for each panel.
            size: Width and height of each panel [px], even numbers.
            chart: Settings of the chart below the panels.

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
            """Return a text at a position from the frame's top left corner [px]."""
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
        """Texts above the panels for a status of each; unused if the film has one status."""
        axes = figure.add_axes(
            (LEFT / width, BELOW / height, (right - LEFT) / width, (CHART - BELOW - ABOVE) / height)
        )
        self._chart = RunningChart(axes, chart)
        self.size = size
        self._canvas = FigureCanvasAgg(figure)
        self._ground: object = None  # the drawn figure without what changes in each frame
        self._video = VideoWriter(to, rate, width, height) if isinstance(to, Path) else to
        self.close = self._video.close
        """Finish the file."""
        self.abandon = self._video.abandon
        """Close the file after an error; it keeps the frames that it has whole, and is removed if
        it has none."""

    def add(
        self,
        time: float,
        panels: Sequence[Image],
        values: Sequence[float],
        statuses: Sequence[str],
        note: str,
    ) -> None:
        """Write a frame of the film: pictures, the chart up to `time`, the time, note and status.

        Args:
            time: Time of the frame [s], later than that of the last one.
            panels: For each caption an image (height, width, 3) of the size that the constructor
                got.
            values: A value for each curve of the chart; nan leaves a gap.
            statuses: Names of a `Status`, such as "LOCKED", or "" for none: one for the film, or
                one for each panel.
            note: Text before the time, such as "frame 12".

        Raises:
            OSError: The file cannot be written.
        """
        self._note.set_text(f"{note}    t = {time:.2f} s")
        badges = [self._status] if len(statuses) == 1 else self._badges
        for badge, status in zip(badges, statuses, strict=True):
            badge.set(text=status, color=STATUS_ON_WHITE[status])
        if self._chart.add(time, values, statuses) or self._ground is None:
            self._canvas.draw()
            self._ground = self._canvas.copy_from_bbox(self._canvas.figure.bbox)
        self._canvas.restore_region(self._ground)
        for artist in (self._note, *badges, *self._chart.artists):
            self._canvas.figure.draw_artist(artist)
        page = np.asarray(self._canvas.buffer_rgba())[..., :3].copy()
        top = HEAD + CAPTION
        for i, picture in enumerate(panels):
            left = MARGIN + i * (self.size[0] + MARGIN)
            page[top : top + self.size[1], left : left + self.size[0]] = picture
        self._video.add(page, time)
