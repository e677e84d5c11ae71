"""The films, logs and viewers of `servobench run` and `track`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from servo.cli.guard import CTRL_C, exit_code
from servo.cli.options import PORT
from servo.cli.terminal import plain
from servo.closing import closing
from servo.mistake import Mistake, check_suffix, unwritable
from servo.output.light_page import LightPage, NewestPicture, ThrottledSink
from servo.output.sinks import PacedSink, Sink
from sim.camera import gl

if TYPE_CHECKING:
    from servo.loop.episode import Episode
    from servo.output.recording.live import LiveViewer
    from servo.ros2.server import Server
    from tracking.sequences.sources import Source
    from tracking.types import Region

VIEWER = "the viewer"


@dataclass(frozen=True, slots=True)
class Outputs:
    """Values of the options of `run` and `track` for films (MP4), logs (MCAP) and live viewers, and
    the connection of a run to ROS 2. `live` shows the run in a window, with `web` in a browser: if
    `light` is True on the light page (a film of JPEG pictures), if it is False in Rerun's viewer;
    None takes the light page on a machine without a GPU, else Rerun's viewer. `speed` is a multiple
    of real time (None: 1), `port` the TCP port of a viewer (None: 9090).
    """

    video: Path | None = None
    mcap: Path | None = None
    live: bool = False
    web: bool = False
    light: bool | None = None
    speed: float | None = None
    port: int | None = None
    server: Server | None = None
    """Connection of the run to ROS 2, or None."""

    @property
    def files(self) -> list[Path]:
        """Paths of the film (MP4) and the log (MCAP) that were asked for."""
        return [path for path in (self.video, self.mcap) if path is not None]

    @property
    def pace(self) -> float:
        """Simulated seconds in a second of the wall clock in a live viewer."""
        return self.speed or 1.0

    def check(self) -> None:
        """Check the options, before anything is written; a file to write is made and removed again
        as a trial.

        Raises:
            Mistake: An option needs another option or a package, a file exists already, has a wrong
                suffix or cannot be written.
            Refused: The disk is full or fails, or too many files are open.
        """
        needs = (
            ("--web", self.web, "--live", self.live),
            ("--light", self.light is not None, "--web", self.web),
            ("--speed", self.speed is not None, "--live", self.live),
            ("--port", self.port is not None, "--live", self.live),
        )
        for option, is_given, needed, is_there in needs:
            if is_given and not is_there:
                raise Mistake(f"{option} has no effect without {needed}: add {needed}")
        if self.mcap is not None:
            from servo.output.mcap_file import check_installed

            check_suffix(self.mcap, ".mcap")
            check_installed()
        if self.video is not None:
            check_suffix(self.video, ".mp4")
        for path in self.files:
            check_writable(path)

    def viewer(self) -> LiveViewer | LightPage | None:
        """Start and return the live viewer (a window or a page in a browser); None without the
        option --live.

        Raises:
            Mistake: There is no display for a window, or a port is in use.
            Refused: The viewer's server does not start.
        """
        if not self.live:
            return None
        if self.web and (self.light or (self.light is None and not gl.has_gpu())):
            return LightPage(self.port or PORT)
        from servo.output.recording.live import LiveViewer

        return LiveViewer(web=self.web, port=self.port or PORT)

    def of_run(
        self, episode: Episode, viewer: LiveViewer | LightPage | None
    ) -> dict[Path | str, Sink]:
        """Open and return the outputs that get each step of a run: film, log, viewer and ROS 2, as
        far as the options ask for them. The keys are the paths of files, or names such as "the
        viewer".

        Args:
            episode: The run.
            viewer: The viewer from the method `viewer`, which shows the run in real time, or
                `speed` times as fast; None: no viewer.
        """
        found: dict[Path | str, Sink] = {}
        if self.video is not None:
            found[self.video] = _film_of(episode)(self.video)
        if self.mcap is not None:
            from servo.output.mcap_file import RunMcap

            found[self.mcap] = RunMcap(self.mcap, episode)
        if viewer is not None:
            from servo.output.recording.log import RerunLog

            sink = _shown(viewer, _film_of(episode), partial(RerunLog, episode=episode))
            found[VIEWER] = PacedSink(sink, self.pace, lambda step: step.frame.time)
        if self.server is not None:
            found["ROS 2"] = self.server.serving(episode)
        return found

    def of_track(
        self, region: Region, source: Source, title: str, viewer: LiveViewer | LightPage | None
    ) -> dict[Path | str, Sink]:
        """Open and return the outputs that get each picture of a track and the tracker's estimate:
        film, log and viewer, as far as the options ask for them. The keys are the paths of files,
        or "the viewer".

        Args:
            region: The target's rectangle in the first picture (size in px).
            source: The pictures.
            title: Title of the film.
            viewer: The viewer from the method `viewer`, which shows pictures in real time, or
                `speed` times as fast; those of a live source at once. None: no viewer.
        """
        from tracking.drawing.annotated_video import AnnotatedVideo

        found: dict[Path | str, Sink] = {}
        end = None if source.count is None else (source.count - 1) / source.rate
        film = partial(AnnotatedVideo, rate=source.rate, region=region, title=title, end=end)
        if self.video is not None:
            found[self.video] = film(self.video)
        if self.mcap is not None:
            from servo.output.mcap_file import TrackMcap

            found[self.mcap] = TrackMcap(self.mcap, region)
        if viewer is not None:
            from servo.output.recording.track_log import TrackLog

            found[VIEWER] = _shown(viewer, film, partial(TrackLog, region=region))
            if source.count is not None:  # a live source has a pace of its own
                found[VIEWER] = PacedSink(found[VIEWER], self.pace, lambda shot: shot.picture.time)
        return found


def _film_of(episode: Episode) -> Callable[[Path | NewestPicture], Sink]:
    """Return the maker of a run's film, which is given the film's file or the page that shows its
    frames.
    """
    from servo.output.film import RunFilm  # only now: PyAV takes 0.1 s

    run = episode.scenario.run
    return partial(RunFilm, title=f"{episode.scenario.name}, seed {run.seed}", end=run.duration)


def _shown(
    viewer: LiveViewer | LightPage,
    film: Callable[[NewestPicture], Sink],
    log: Callable[..., Sink],
) -> Sink:
    """Return the output that passes frames to a viewer.

    Args:
        viewer: The viewer.
        film: Makes the output of the light page, which shows a film.
        log: Makes the output of Rerun's viewer, given the viewer and, as `every`, the time between
            two batches of data [s].
    """
    if isinstance(viewer, LightPage):
        return ThrottledSink(film(viewer.pictures))
    from servo.output.recording.live import EVERY

    return log(viewer, every=EVERY)


def announce(viewer: LiveViewer | LightPage | None, console: Console) -> None:
    """Print the address of the viewer's web page; nothing without a viewer (None), or for a viewer
    in a window.
    """
    if viewer is not None and viewer.page is not None:
        plain(console, f"the page of the viewer: {viewer.page}")


def linger(viewer: LiveViewer | LightPage | None, console: Console) -> None:
    """Keep a viewer open until the user closes its window or presses Ctrl-C, then stop it; a page
    in a browser ends by Ctrl-C alone. Without a viewer (None) return at once.

    Raises:
        Refused: The viewer's server has ended.
        KeyboardInterrupt: Another signal than Ctrl-C came.
    """
    if viewer is None:
        return
    close = "press Ctrl-C" if viewer.page else "close the viewer, or press Ctrl-C,"
    with closing(viewer.stop):
        try:
            # The user may press Ctrl-C as soon as this line appears.
            plain(console, f"{close} to end")
            viewer.wait()
        except KeyboardInterrupt as cause:
            if exit_code(cause) != CTRL_C:
                raise


def check_place(path: Path | None, *suffixes: str) -> None:
    """Check the path of a file to write: its folder exists, nothing but a regular file is at the
    path already, and the name ends in one of the suffixes. Whether the file can be written is not
    tried. None is accepted.

    Args:
        path: The path, or None.
        *suffixes: Allowed endings in small letters, such as ".png".

    Raises:
        Mistake: The folder is missing, a link, a folder or another thing that is not a regular file
            is at the path, or the suffix differs.
    """
    if path is None:
        return
    if not path.absolute().parent.is_dir():
        raise Mistake(f"{path}: there is no folder {path.parent}: make it first")
    if path.is_symlink():
        raise Mistake(
            f"{path}: this is a link, and nothing is written through a link: name the file itself"
        )
    if path.exists() and not path.is_file():
        raise Mistake(f"{path}: this is not a file; name a file to write, such as x{suffixes[0]}")
    check_suffix(path, *suffixes)


def check_writable(path: Path) -> None:
    """Check that a new file can be written at a path, by making an empty one and removing it.

    Raises:
        Mistake: The file exists, its folder does not exist, or the file cannot be written.
        Refused: The disk is full or fails, or too many files are open.
    """
    try:
        path.open("xb").close()
        path.unlink()
    except FileExistsError:
        raise Mistake(f"{path}: this file exists already; choose another name") from None
    except OSError as error:
        raise unwritable(path, error, "this file") from None
