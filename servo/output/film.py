"""The film of a run: the camera with its overlays, the room, and the errors over time."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from servo.loop.step import Step
from servo.output.room_view import RoomView
from tracking.drawing import colours
from tracking.drawing.film_page import FilmPage, panel
from tracking.drawing.running_chart import Chart

PANEL = (616, 462)
"""Two of them, with the margins, are 1280 px wide; the film is 720 px high."""
CAPTIONS = ("Camera: estimate green, goal red, truth white", "The room")
CURVES = {
    "true centre to goal": colours.CURVES[0],
    "estimated to true centre": colours.CURVES[1],
}


class RunFilm:
    """Writer of one film."""

    def __init__(self, path: Path, title: str = "", end: float | None = None) -> None:
        """Make a film; `end` is the run's last time [s], if it is known."""
        self._path = path
        self._title = title
        self._end = end
        self._opened: tuple[FilmPage, RoomView] | None = None

    def add(self, step: Step) -> None:
        """Write a step, which still has its picture.

        Raises:
            OSError: The file cannot be written.
        """
        if self._opened is None:
            rate = 1 / step.scene.period
            chart = Chart(CURVES, "distance [px]", self._end)
            film = FilmPage(self._path, rate, self._title, CAPTIONS, PANEL, chart)
            self._opened = film, RoomView(step.scene.room, *PANEL)
        film, room = self._opened
        marks = (
            (step.truth.corners, colours.TRUTH),
            (step.goal_corners, colours.GOAL),
            (step.estimate.outline(step.region), colours.ESTIMATE),
        )
        views = (
            panel(step.frame.image, *PANEL, marks, step.estimate.particles),
            room.render(step.bodies),
        )
        errors = step.servo_error, step.tracking_error
        note = f"error {step.servo_error:.1f} px"
        film.add(step.frame.time, views, errors, step.estimate.status.name, note)

    def close(self) -> None:
        """Finish the file."""
        self._finish(whole=True)

    def abandon(self) -> None:
        """Close the file as it is; it can be played up to here."""
        self._finish(whole=False)

    def _finish(self, *, whole: bool) -> None:
        if self._opened is None:
            return
        film, room = self._opened
        self._opened = None
        room.close()
        if whole:
            film.close()
        else:
            film.abandon()


def write_film(steps: Iterable[Step], path: Path, title: str = "") -> Path:
    """Write the film of a run's steps, which still have their pictures, as `servo.run` gives them.

    Args:
        steps: In order; a list, or the run itself, which is then filmed on the way.
        path: The file to write, an MP4; an older one is replaced.
        title: Its first line.

    Returns:
        The path.

    Raises:
        OSError: The file cannot be written.
    """
    end = steps[-1].frame.time if isinstance(steps, Sequence) and steps else None
    film = RunFilm(path, title, end)
    try:
        for step in steps:
            film.add(step)
    finally:
        film.close()
    return path
