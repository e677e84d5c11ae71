"""Viewing a recording: in Rerun's window, in a browser, or drawn into a PNG file."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from servo.mistake import Mistake
from sim.files import reading
from tracking.files import atomic

MAGIC = (b"RRF2", b"RRIO")
"""First bytes of Rerun's files."""
VULKAN = "on a machine without a GPU run 'apt-get install libvulkan1 mesa-vulkan-drivers'"
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
LOADED_WITHIN, POLL = 30.0, 0.25
DRAWN_AFTER = 3.0
"""Time that a machine without a GPU needs to draw a scene for the first time [s]."""


def recording_in(folder: Path) -> Path:
    """The recording in a folder of `run` or `track`."""
    track = folder / "track.rrd"
    return track if track.exists() else folder / "run.rrd"


def check(path: Path) -> None:
    """Refuse a file that is not a recording.

    Raises:
        Mistake: The file is missing, or it is not one of Rerun's.
    """
    try:
        with reading.opened(path, "recording") as file:
            begin = file.read(4)
    except ValueError as error:
        raise Mistake(str(error)) from None
    if begin not in MAGIC:
        raise Mistake(f"{path}: this is not a Rerun recording (.rrd)")


def show(path: Path, *, web: bool) -> int:
    """Open the viewer and wait until it is closed; its exit code.

    Raises:
        Mistake: There is no display for a window.
    """
    if not web and sys.platform == "linux" and not any(map(os.environ.get, DISPLAYS)):
        raise Mistake("there is no display here: use --web, or --png FILE for a picture")
    command = [sys.executable, "-m", "rerun", str(path), "--bind", "127.0.0.1"]
    if web:
        command.append("--web-viewer")
    return subprocess.call(command)


def picture(path: Path, png: Path, at: float, panel: str | None = None) -> None:
    """Draw the viewer at a simulated time into a PNG file, without a window.

    Args:
        path: The recording.
        png: The file to write.
        at: Simulated time [s].
        panel: The entity of the only panel to draw, such as "world"; None: all panels.

    Raises:
        Mistake: The viewer cannot start, has no such panel, or does not show the recording.
    """
    _check_png(path, png)
    try:
        with _quiet_viewer() as viewer:
            viewer.open(str(path.resolve()))
            end = time.monotonic() + LOADED_WITHIN
            while not viewer.get_state().views:
                if time.monotonic() > end:
                    late = f"the viewer did not show this within {LOADED_WITHIN:g} s"
                    raise Mistake(f"{path}: {late}")
                time.sleep(POLL)
            viewer.set_time("sim_time", duration=at, play_state="paused")
            time.sleep(DRAWN_AFTER)
            views = {view.origin.strip("/"): view.view_id for view in viewer.get_state().views}
            if panel is not None and panel.strip("/") not in views:
                raise Mistake(f"there is no panel '{panel}'; there is {', '.join(sorted(views))}")
            view = None if panel is None else views[panel.strip("/")]
            drawn = viewer.take_screenshot(view_id=view)
    except (RuntimeError, OSError):
        raise Mistake(f"the viewer does not start without a window: {VULKAN}") from None
    atomic.write(png.parent, png.name, drawn)


def _check_png(path: Path, png: Path) -> None:
    """Refuse a PNG file that cannot or must not be written.

    Raises:
        Mistake: Its folder is missing, it is not a file, or it is the recording.
    """
    if not png.absolute().parent.is_dir():
        raise Mistake(f"{png}: there is no such folder to write to")
    if png.exists() and not png.is_file():
        raise Mistake(f"{png}: this is not a file; --png takes the file to write")
    if png.exists() and png.samefile(path):
        raise Mistake(f"{png}: this is the recording itself")


def _quiet_viewer() -> ViewerClient:
    """A viewer without a window, with its log kept away from our stderr."""
    stderr, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        # The viewer of this rerun-sdk, not one on PATH.
        rerun = Path(sysconfig.get_path("scripts")) / "rerun"
        return ViewerClient.spawn(
            headless=True, port=_free_port(), hide_welcome_screen=True, executable_path=str(rerun)
        )
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nothing)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
