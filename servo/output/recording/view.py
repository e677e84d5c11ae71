"""Functions that show the file of a Rerun recording in Rerun's window, or draw it into a PNG
file.
"""

import socket
import subprocess
import sysconfig
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from servo.closing import closing
from servo.mistake import Mistake, as_mistake
from servo.output.local_page import has_display
from servo.output.recording.live import HOST, PROGRAM
from sim.files import reading
from sim.stderr import silent_libraries
from tracking.files import atomic

MAGIC = (b"RRF2", b"RRIO")
"""First bytes of Rerun's files."""
VULKAN = (
    "without a GPU the viewer needs the packages libvulkan1 and mesa-vulkan-drivers; on a busy "
    "machine, try again"
)
LOADED_WITHIN = 30.0
"""Longest time that the viewer may take to show a recording [s]."""
POLL = 0.25
"""Time between two questions to the viewer [s]."""
DRAWN_AFTER = 3.0
"""Time that a machine without a GPU needs to draw a scene for the first time [s]."""


def recording_in(folder: Path) -> Path:
    """Return the path of the recording in a folder that `run` or `track` wrote: track.rrd if it
    exists, else run.rrd, which may be missing.
    """
    track = folder / "track.rrd"
    return track if track.exists() else folder / "run.rrd"


def check(path: Path) -> None:
    """Check by its first bytes that a file is a Rerun recording.

    Raises:
        Mistake: The file is missing, or is not a recording of Rerun.
    """
    with as_mistake(), reading.opened(path, "recording") as file:
        begin = file.read(4)
    if begin not in MAGIC:
        raise Mistake(f"{path}: this is not a Rerun recording (.rrd): name one")


def show(path: Path) -> int:
    """Open the file of a recording in the window of Rerun's viewer, wait until the window is
    closed, and return the exit code of the viewer.

    Raises:
        Mistake: There is no display for a window.
    """
    if not has_display():
        raise Mistake("there is no display here: use --web, or --png FILE for a picture")
    window = subprocess.Popen([PROGRAM, str(path), "--bind", HOST])
    with closing(window.terminate, window.wait):
        return window.wait()


def picture(path: Path, png: Path, at: float, panel: str | None = None) -> None:
    """Draw a recording, as Rerun's viewer shows it at a simulated time, into a PNG file, without
    opening a window.

    Args:
        path: File of the recording.
        png: File to write; an older one is replaced.
        at: Simulated time that is drawn [s].
        panel: Path of the entity that a panel of the viewer shows, such as "world", to draw this
            panel alone; None: draw the whole viewer.

    Raises:
        Mistake: The viewer cannot start, has no such panel, or does not load the recording within
            30 s.
        OSError: The PNG file cannot be written.
    """
    try:
        with _viewer() as viewer:
            viewer.open(str(path.resolve()))
            end = time.monotonic() + LOADED_WITHIN
            while not viewer.get_state().views:
                if time.monotonic() > end:
                    late = f"the viewer did not load this recording within {LOADED_WITHIN:g} s"
                    raise Mistake(f"{path}: {late}; on a busy machine, try again")
                time.sleep(POLL)
            viewer.set_time("sim_time", duration=at, play_state="paused")
            time.sleep(DRAWN_AFTER)
            views = {view.origin.strip("/"): view.view_id for view in viewer.get_state().views}
            if panel is not None and panel.strip("/") not in views:
                raise Mistake(
                    f"{path}: this recording has no panel '{panel}'; it has "
                    f"{', '.join(sorted(views))}"
                )
            view = None if panel is None else views[panel.strip("/")]
            drawn = viewer.take_screenshot(view_id=view)
    except (RuntimeError, OSError):
        raise Mistake(f"the viewer cannot draw without a window: {VULKAN}") from None
    atomic.write(png.parent, png.name, drawn)


def _viewer() -> ViewerClient:
    """Start the viewer of this rerun-sdk without a window, and return its client."""
    rerun = Path(sysconfig.get_path("scripts")) / "rerun"
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    with silent_libraries():  # the viewer logs to our stderr
        return ViewerClient.spawn(
            headless=True, port=port, hide_welcome_screen=True, executable_path=str(rerun)
        )
