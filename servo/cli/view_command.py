"""The command `servobench view`: open a recording in the Rerun viewer, or draw a PNG."""

from pathlib import Path

import click
from rich.console import Console

from servo.cli.options import PORT
from servo.cli.outputs import announce, check_place, linger
from servo.mistake import Mistake
from servo.output.recording import view
from servo.output.recording.live import LiveViewer


def run(
    recording: Path, web: bool, port: int | None, png: Path | None, at: float, panel: str | None
) -> int | None:
    """Show a recording in Rerun's window, in a browser or as a picture.

    Args:
        recording: The folder of a run or a track, or an .rrd file.
        web: Whether to show it in a browser.
        port: TCP port of the data, only with `web`; None: 9090.
        png: A PNG file to draw in place of a window; None: show the recording.
        at: Simulated time that the picture shows [s].
        panel: Entity of the only panel to draw, such as "world"; None: the whole viewer.

    Returns:
        The exit code of Rerun's window; None for a browser or a picture.

    Raises:
        Mistake: The file is no recording, an option has no effect, there is no display for a
            window, or a port is in use.
        Refused: The viewer's server does not start, or has ended.
    """
    if port is not None and not web:
        raise Mistake("--port has no effect without --web: add --web")
    path = view.recording_in(recording) if recording.is_dir() else recording
    view.check(path)
    if png is not None:
        check_place(png, ".png")
        view.picture(path, png, at, panel)
        click.echo(png)
        return None
    if not web:
        return view.show(path)
    viewer = LiveViewer(web=True, port=port or PORT, recording=path)
    announce(viewer, Console())
    linger(viewer, Console())
    return None
