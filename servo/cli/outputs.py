"""The options of `run` and `track` for films, logs and viewers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from servo.cli import options as opt
from servo.cli.guard import CTRL_C, exit_code
from servo.closing import closing
from servo.mistake import Mistake, check_suffix, unwritable
from servo.output.sinks import PacedSink, Sink
from sim.camera import gl

if TYPE_CHECKING:
    from rich.console import Console

    from servo.loop.episode import Episode
    from servo.output.light_page import LightPage, NewestPicture
    from servo.output.recording.live import LiveViewer
    from servo.ros2.server import Server
    from tracking.sequences.sources import Source
    from tracking.types import Region

PORT = 9090
PORTS = click.IntRange(1024, 65_534)
VIEWER = "the viewer"
NEEDS = {"web": "live", "light": "web", "speed": "live", "port": "live"}
"""Options, each with the option that it needs."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """Values of the options of `run` and `track` for films, logs and viewers."""

    video: Path | None = None
    mcap: Path | None = None
    live: bool = False
    web: bool = False
    light: bool | None = None
    """Whether the browser gets the light page; None: only on a machine without a GPU."""
    speed: float | None = None
    port: int | None = None
    server: Server | None = None
    """Connects the run to ROS 2; None: the run does without."""

    @property
    def files(self) -> list[Path]:
        """The films and logs to write."""
        return [path for path in (self.video, self.mcap) if path is not None]

    def check(self) -> None:
        """Check the options before anything is written.

        Raises:
            Mistake: An option needs another one or a package, or a file cannot be written.
        """
        given = {
            "web": self.web,
            "light": self.light is not None,
            "speed": self.speed is not None,
            "port": self.port is not None,
        }
        for name, other in NEEDS.items():
            if given[name] and not getattr(self, other):
                raise Mistake(f"--{name} needs --{other}")
        for path, suffix in ((self.video, ".mp4"), (self.mcap, ".mcap")):
            if path is not None:
                check_suffix(path, suffix)
        if self.mcap is not None:
            from servo.output.mcap_file import check_installed

            check_installed()
        for path in self.files:
            check_writable(path)

    def viewer(self) -> LiveViewer | LightPage | None:
        """Return the viewer of --live; None without this option.

        Raises:
            Mistake: There is no display, or a port is in use.
        """
        if not self.live:
            return None
        if self.web and (self.light or (self.light is None and not gl.has_gpu())):
            from servo.output.light_page import LightPage

            return LightPage(self.port or PORT)
        from servo.output.recording.live import LiveViewer

        return LiveViewer(web=self.web, port=self.port or PORT)

    def of_run(
        self, episode: Episode, viewer: LiveViewer | LightPage | None
    ) -> dict[Path | str, Sink]:
        """Return the sinks that take the steps of a run, by their file or name."""
        from servo.output.film import RunFilm

        found: dict[Path | str, Sink] = {}
        run = episode.scenario.run
        film = partial(RunFilm, title=f"{episode.scenario.name}, seed {run.seed}", end=run.duration)
        if self.video is not None:
            found[self.video] = film(self.video)
        if self.mcap is not None:
            from servo.output.mcap_file import RunMcap

            found[self.mcap] = RunMcap(self.mcap, episode)
        if viewer is not None:
            from servo.output.recording.log import RerunLog

            sink = _shown(viewer, film, partial(RerunLog, episode=episode))
            found[VIEWER] = PacedSink(sink, self.speed or 1.0, lambda step: step.frame.time)
        if self.server is not None:
            found["ROS 2"] = self.server.serving(episode)
        return found

    def of_track(
        self, region: Region, source: Source, title: str, viewer: LiveViewer | LightPage | None
    ) -> dict[Path | str, Sink]:
        """Return the sinks that take the shots of a track, by their file or name."""
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
                speed = self.speed or 1.0
                found[VIEWER] = PacedSink(found[VIEWER], speed, lambda shot: shot.picture.time)
        return found


NOTHING_MORE = Outputs()


def _shown(
    viewer: LiveViewer | LightPage,
    film: Callable[[NewestPicture], Sink],
    log: Callable[..., Sink],
) -> Sink:
    """Return the sink that feeds a viewer.

    Args:
        viewer: The viewer.
        film: Makes the sink of the light page, which shows a film.
        log: Makes the sink of Rerun's viewer, given the viewer and the time between pictures.
    """
    from servo.output.light_page import LightPage, ThrottledSink

    if isinstance(viewer, LightPage):
        return ThrottledSink(film(viewer.pictures))
    from servo.output.recording.live import EVERY

    return log(viewer, every=EVERY)


def announce(viewer: LiveViewer | LightPage | None, console: Console) -> None:
    """Print the address of a viewer that runs in a browser."""
    if viewer is not None and viewer.page is not None:
        from servo.cli.terminal import plain

        plain(console, f"watch it at {viewer.page}")


def linger(viewer: LiveViewer | LightPage | None, console: Console) -> None:
    """Keep a viewer open until the user closes it or presses Ctrl-C."""
    if viewer is None:
        return
    from servo.cli.terminal import plain

    close = "press Ctrl-C" if viewer.page else "close the viewer, or press Ctrl-C,"
    with closing(viewer.stop):
        try:
            # The user may press Ctrl-C as soon as this line appears.
            plain(console, f"{close} to end")
            viewer.wait()
        except KeyboardInterrupt as cause:
            if exit_code(cause) != CTRL_C:
                raise


def serve(recording: Path, port: int) -> None:
    """Show a recording in a browser until Ctrl-C.

    Raises:
        Mistake: A port is in use.
        Refused: The server does not start, or has ended.
    """
    from rich.console import Console

    from servo.output.recording.live import LiveViewer

    viewer = LiveViewer(web=True, port=port, recording=recording)
    announce(viewer, Console())
    linger(viewer, Console())


def check_writable(path: Path) -> None:
    """Check that a new file can be written.

    Raises:
        Mistake: The file exists, its folder does not, or the file cannot be written.
    """
    if not path.parent.exists():
        raise Mistake(f"{path}: there is no folder {path.parent} yet: make it first")
    try:
        path.open("xb").close()
        path.unlink()
    except FileExistsError:
        raise Mistake(f"{path}: there is such a file already; choose another name") from None
    except OSError as error:
        raise unwritable(path, error, "this file") from None


def output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add these options to a command, which gets them as one argument, `outputs`."""

    @wraps(command)
    def gathered(
        *,
        video: Path | None,
        mcap: Path | None,
        live: bool,
        web: bool,
        light: bool | None,
        speed: float | None,
        port: int | None,
        **others: Any,
    ) -> Any:
        return command(outputs=Outputs(video, mcap, live, web, light, speed, port), **others)

    added = (
        click.option("--video", metavar="FILE.mp4", type=opt.PATH, help="Also write a film."),
        click.option(
            "--mcap",
            metavar="FILE.mcap",
            type=opt.PATH,
            help="Also write a log for Foxglove; needs servobench[mcap].",
        ),
        click.option("--live", is_flag=True, help="Watch in Rerun's window, in real time."),
        click.option("--web", is_flag=True, help="Watch in a browser instead; with --live."),
        click.option(
            "--light/--no-light",
            default=None,
            help="With --web: a light page, or Rerun's (default: Rerun's where there is a GPU).",
        ),
        click.option(
            "--speed",
            type=opt.FiniteRange(0.01, 1000.0),
            help="Times real time, with --live (default: 1).",
        ),
        click.option(
            "--port",
            type=PORTS,
            help=f"Of the data, with --live; Rerun's page has the next one (default: {PORT}).",
        ),
    )
    for option in reversed(added):
        gathered = option(gathered)
    return gathered
