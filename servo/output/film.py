"""Films (MP4) of runs: the camera's picture with outlines of the target, the scene from outside,
and curves of the errors.
"""

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
"""Width and height [px] of each of the two pictures in a frame of a film of one run; with margins,
title and chart, the frame has 1280 by 720 px."""
PANEL_OF_TWO = (448, 336)
"""Width and height [px] of a picture in a film of two runs, in which each run has its camera's
picture above that of its room."""
LONGEST = 46
"""Characters of a caption that fit above a picture in a film of two runs, beside the status."""
TITLE_OF_TWO = "Estimate green, goal red, truth white"
MARKS = "estimate green, goal red, truth and paths of its corners white"
CAPTIONS = (f"Camera: {MARKS}", "The room, and beside the camera")
CURVES = {
    "true centre to goal": colours.CURVES[0],
    "true corners to theirs, mean": colours.CURVES[2],
    "estimated to true centre": colours.CURVES[1],
}
FRUSTUM = 0.25
"""Depth in front of the camera at which the room shows the border of the camera's picture [m]."""
FOLLOWING = 3
"""Width and height of the picture of the room, over those of the view that follows the camera."""
BESIDE = np.array([0.6, -1.1, 0.45])
"""Position, in the world's axes, from which this view is taken, relative to the middle between
camera and target [m]; if these are more than 1 m apart, times their distance in metres.
"""
BORDER = 2
WHITE = 255
"""Width [px] and brightness of the lines around this view."""
PARTS = 16
"""Positions of lines are rounded to 1 / PARTS of a pixel."""


class RunViews:
    """Draws two pictures for each step of a run, both of the given `size` (width, height) [px]: the
    camera's picture, and the room (the scene from outside).

    The camera's picture has the target's outlines (true: white, at the goal: red, estimated:
    green), the paths of its true corners so far, and the tracker's particles, if there are any. The
    room has the camera's field of view as a pyramid, and the camera's path so far, both drawn over
    everything. In the room's lower right corner is a second view, which follows the camera.
    """

    def __init__(self, camera: Camera, room: MjModel, size: tuple[int, int]) -> None:
        """Create the renderers of the room.

        Args:
            camera: The run's camera.
            room: The MuJoCo model of the world.
            size: Width and height of each picture [px].
        """
        borders = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (camera.width, camera.height)
        self._frustum = FRUSTUM * np.insert(camera.normalise(borders), 2, 1.0, axis=1)
        self._size = size
        self._room = RoomView(room, *size)
        self._beside = RoomView(room, size[0] // FOLLOWING, size[1] // FOLLOWING)
        self._path: list[Array] = []
        self._corners: list[Array] = []

    def close(self) -> None:
        """Release the OpenGL buffers of the renderers."""
        self._room.close()
        self._beside.close()

    def draw(self, step: Step) -> tuple[Image, Image]:
        """Return the picture of the camera and that of the room at a step, each RGB (H, W, 3) of
        the given size. Call it once for each step, in order, because the drawn paths grow with each
        call.
        """
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
        """Return the room as RGB (H, W, 3), with the second picture, which follows the camera, in
        its corner.
        """
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
    """Sink (receiver of the steps of a run) that draws each step as a frame of a film, for an MP4
    file or another receiver of frames (`to`). `end` is the time of the last step [s]; None:
    unknown.
    """

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
        """Append a frame that shows a step; the step must still have its picture.

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
        """Finish the film; if no step was added, no file is written.

        Raises:
            OSError: The file cannot be written.
        """
        self._finish(whole=True)

    def abandon(self) -> None:
        """Close the file after an error, without finishing the film; all frames but the last can be
        played.
        """
        self._finish(whole=False)

    def _finish(self, *, whole: bool) -> None:
        if self._opened is not None:
            film, views = self._opened
            self._opened = None
            with closing(film.close if whole else film.abandon, views.close):
                pass


def write_film(steps: Iterable[Step], path: Path, title: str = "") -> Path:
    """Write a film of the steps of a run, which must still have their pictures (those of
    `servo.run` do), as an MP4 file.

    Args:
        steps: All steps in order: a list, or an iterator that makes them, such as a run that is
            filmed as it goes on. Without steps no file is written.
        path: MP4 file to write; an older one is replaced.
        title: First line of the film.

    Returns:
        `path`.

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
    """Run two episodes, and write one film (MP4) that shows both beside each other. When the
    shorter run has ended, its last picture stays, and the film says "(ended)" beside its error.

    Args:
        episodes: Two episodes (runs that can be stepped) that have not begun.
        names: Captions above the two halves; each gets the number of its half, and loses its middle
            if it is too long.
        path: MP4 file to write; an older one is replaced.
        written: Called after each frame with the text beside the film's title: both runs' mean
            distances between the target's true corners and their goals, such as "error 3.1 px and
            2.8 px (ended)".

    Raises:
        Mistake: The rates of the cameras differ.
        OSError: The file cannot be written.
    """
    worlds = [episode.world for episode in episodes]
    rates = [1 / world.period for world in worlds]
    if rates[0] != rates[1]:
        raise Mistake(
            f"film: the cameras have different rates, {rates[0]:g} and {rates[1]:g} Hz: give both "
            "the same camera.rate"
        )
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
            ended = ["" if new else " (ended)" for new in pair]
            told = zip(errors, ended, strict=True)
            note = "error " + " and ".join(f"{error:.1f} px{end}" for error, end in told)
            statuses = [step.estimate.status.name for step in steps]
            film.add(max(step.frame.time for step in steps), pictures, errors, statuses, note)
            written(note)


def _shortened(caption: str) -> str:
    """Return a caption of at most 47 characters: the middle of a longer one is left out.

    The end stays, because the difference between two runs often comes last.

    >>> _shortened("2: reversal --set run.duration=4.0 --set estimator.kind=none")
    '2: reversal --set run.d…set estimator.kind=none'
    """
    if len(caption) <= LONGEST:
        return caption
    half = LONGEST // 2
    return f"{caption[:half]}…{caption[-half:]}"
