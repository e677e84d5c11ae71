"""The film of a run: the camera with its overlays, the room, and the errors over time."""

from collections.abc import Callable, Iterable, Sequence
from itertools import zip_longest
from pathlib import Path

import cv2
import numpy as np
from mujoco import MjModel

from servo.closing import closing
from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.room_view import RoomView
from sim.types import Array, Camera, Image
from tracking.drawing import colours
from tracking.drawing.film_page import FilmPage, FrameReceiver, panel
from tracking.drawing.running_chart import Chart

PANEL = (616, 462)
"""Two of them, with the margins, are 1280 px wide; the film is 720 px high."""
PANEL_OF_TWO = (448, 336)
"""The same where two runs are beside each other, with each room below its camera."""
LONGEST = 46
"""Letters of a caption that fit above a picture there, beside its status."""
TITLE_OF_TWO = "Estimate green, goal red, truth white"
MARKS = "estimate green, goal red, truth and paths of its corners white"
CAPTIONS = (f"Camera: {MARKS}", "The room, and beside the camera")
CURVES = {
    "true centre to goal": colours.CURVES[0],
    "true corners to theirs, mean": colours.CURVES[2],
    "estimated to true centre": colours.CURVES[1],
}
FRUSTUM = 0.25
"""Distance from the camera at which the room shows the border of its picture [m]."""
FOLLOWING = 3
"""Times smaller than the picture of the room is the view that follows the camera."""
BESIDE = np.array([0.6, -1.1, 0.45])
"""Where it is taken from, seen from the middle between camera and target [m]; farther away where
these are more than 1 m apart.
"""
BORDER = 2
WHITE = 255
"""Width [px] and brightness of the lines around it."""
PARTS = 16
"""Parts of a pixel to which lines are drawn."""


class RunViews:
    """The two pictures of each step of one run: what the camera sees, and the room with it.

    The camera's picture has the paths of the target's corners. The room has the camera's pyramid of
    view and its path so far, drawn over all else, and in its corner a view that follows the camera.
    """

    def __init__(self, camera: Camera, room: MjModel, size: tuple[int, int]) -> None:
        """Begin with the camera and the world's model; `size` is that of a picture [px]."""
        borders = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (camera.width, camera.height)
        self._frustum = FRUSTUM * np.insert(camera.normalise(borders), 2, 1.0, axis=1)
        self._size = size
        self._room = RoomView(room, *size)
        self._beside = RoomView(room, size[0] // FOLLOWING, size[1] // FOLLOWING)
        self._path: list[Array] = []
        self._corners: list[Array] = []

    def close(self) -> None:
        """Release the buffers of the renderers."""
        self._room.close()
        self._beside.close()

    def draw(self, step: Step) -> tuple[Image, Image]:
        """Return the pictures of the camera and of the room (H, W, 3)."""
        self._path.append(step.truth.T_world_camera.translation)
        self._corners.append(step.truth.corners)
        return self._draw_camera(step), self._draw_room(step)

    def _draw_camera(self, step: Step) -> Image:
        marks = (
            (step.truth.corners, colours.TRUTH),
            (step.goal.corners, colours.GOAL),
            (step.estimate.outline(step.region), colours.ESTIMATE),
        )
        paths = np.stack(self._corners, axis=1)
        lines = [(path[np.isfinite(path).all(axis=1)], colours.TRUTH) for path in paths]
        return panel(step.frame.image, *self._size, marks, step.estimate.particles, lines)

    def _draw_room(self, step: Step) -> Image:
        """The room, with the following view in its lower right corner."""
        camera = step.truth.T_world_camera.translation
        target = step.truth.T_world_target.translation
        middle = (camera + target) / 2
        self._beside.look(
            middle + BESIDE * max(1.0, float(np.linalg.norm(camera - target))), middle
        )
        room = self._draw_lines(self._room, step)
        inset = self._draw_lines(self._beside, step)
        height, width = inset.shape[:2]
        room[-height - BORDER :, -width - BORDER :] = WHITE
        room[-height:, -width:] = inset
        return room

    def _draw_lines(self, view: RoomView, step: Step) -> Image:
        picture = view.render(step.bodies)
        pose = step.truth.T_world_camera
        corners = pose.apply(self._frustum)
        edges = [np.stack([pose.translation, corner]) for corner in corners]
        for line in (np.stack(self._path), np.append(corners, corners[:1], axis=0), *edges):
            places = np.round(PARTS * view.project(line)).astype(np.int32)
            cv2.polylines(
                picture, [places], False, colours.PARTICLES, 1, cv2.LINE_AA, PARTS.bit_length() - 1
            )
        return picture


class RunFilm:
    """Writer of one film."""

    def __init__(self, to: Path | FrameReceiver, title: str = "", end: float | None = None) -> None:
        """Prepare a film; the file is opened with the first step.

        Args:
            to: The file to write, or the receiver of the frames.
            title: Title of the film.
            end: Time of the last step [s]; None: unknown.
        """
        self._to = to
        self._title = title
        self._end = end
        self._opened: tuple[FilmPage, RunViews] | None = None

    def add(self, step: Step) -> None:
        """Write the frame of a step that has its picture.

        Raises:
            OSError: The file cannot be written.
        """
        if self._opened is None:
            rate = 1 / step.scene.period
            chart = Chart(CURVES, "distance [px]", self._end)
            film = FilmPage(self._to, rate, self._title, CAPTIONS, PANEL, chart)
            self._opened = film, RunViews(step.scene.camera, step.scene.room, PANEL)
        film, views = self._opened
        errors = step.servo_error, float(step.corner_errors.mean()), step.tracking_error
        note = f"error {step.servo_error:.1f} px"
        film.add(step.frame.time, views.draw(step), errors, [step.estimate.status.name], note)

    def close(self) -> None:
        """Finish the file."""
        self._finish(whole=True)

    def abandon(self) -> None:
        """Close the file early; it can be played up to its last whole second."""
        self._finish(whole=False)

    def _finish(self, *, whole: bool) -> None:
        if self._opened is None:
            return
        film, views = self._opened
        self._opened = None
        with closing(views.close):
            if whole:
                film.close()
            else:
                film.abandon()


def write_film(steps: Iterable[Step], path: Path, title: str = "") -> Path:
    """Write the film of a run's steps, which still have their pictures, as `servo.run` gives them.

    Args:
        steps: In order; a list, or the run itself, which is then filmed while it goes on.
        path: The file to write, an MP4; an older one is replaced.
        title: Its first line.

    Returns:
        The path.

    Raises:
        OSError: The file cannot be written.
    """
    end = steps[-1].frame.time if isinstance(steps, Sequence) and steps else None
    film = RunFilm(path, title, end)
    with closing(film.close):
        for step in steps:
            film.add(step)
    return path


def write_film_of_two(
    episodes: tuple[Episode, Episode],
    names: tuple[str, str],
    path: Path,
    written: Callable[[str], None],
) -> None:
    """Run two episodes and film them beside each other; one that has ended stands still.

    Args:
        episodes: Both, not yet run.
        names: Of both, which stand above them and at their curves.
        path: The file to write, an MP4; an older one is replaced.
        written: Is called after each frame, with a note.

    Raises:
        Mistake: The rates of the cameras differ.
        OSError: The file cannot be written.
    """
    worlds = [episode.world for episode in episodes]
    rates = [1 / world.period for world in worlds]
    if rates[0] != rates[1]:
        raise Mistake(f"film: the cameras' rates differ: {rates[0]:g} and {rates[1]:g} Hz")
    end = max(episode.scenario.run.duration for episode in episodes)
    captions = [_shortened(f"{number}: {name}") for number, name in enumerate(names, 1)]
    curves = {"run 1": colours.CURVES[0], "run 2": colours.CURVES[1]}
    chart = Chart(curves, "corners off [px]", end)
    width, height = PANEL_OF_TWO
    film = FilmPage(path, rates[0], TITLE_OF_TWO, captions, (width, 2 * height), chart)
    views = [RunViews(world.camera, world.model, PANEL_OF_TWO) for world in worlds]
    steps: tuple[Step, ...] = ()
    with closing(*(view.close for view in views), film.close):
        for pair in zip_longest(*episodes):
            steps = tuple(new or last for new, last in zip_longest(pair, steps))
            pictures = [np.vstack(view.draw(step)) for view, step in zip(views, steps, strict=True)]
            errors = [float(step.corner_errors.mean()) for step in steps]
            note = "error " + " and ".join(f"{error:.1f} px" for error in errors)
            statuses = [step.estimate.status.name for step in steps]
            film.add(max(step.frame.time for step in steps), pictures, errors, statuses, note)
            written(note)


def _shortened(caption: str) -> str:
    """Return a caption without its middle where it is too long: what differs often comes last.

    >>> _shortened("2: reversal --set run.duration=4.0 --set estimator.kind=none")
    '2: reversal --set run.d…set estimator.kind=none'
    """
    if len(caption) <= LONGEST:
        return caption
    half = LONGEST // 2
    return f"{caption[:half]}…{caption[-half:]}"
