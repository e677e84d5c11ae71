"""A recording in Rerun's window, in a browser, or drawn into a PNG; and its camera's pictures."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import sysconfig
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from servo.mistake import Mistake, check_suffix
from servo.output.display import has_display
from servo.output.recording.archetypes import IMAGE
from sim.files import reading
from sim.types import Array, Image
from tracking.files import atomic

MAGIC = (b"RRF2", b"RRIO")
"""First bytes of Rerun's files."""
VULKAN = "on a machine without a GPU run 'apt-get install libvulkan1 mesa-vulkan-drivers'"
LOADED_WITHIN = 30.0
POLL = 0.25
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
    if not web and not has_display():
        raise Mistake("there is no display here: use --web, or --png FILE for a picture")
    command = [sys.executable, "-m", "rerun", str(path), "--bind", "127.0.0.1"]
    if web:
        command.append("--web-viewer")
    return subprocess.call(command)


def picture(path: Path, png: Path, at: float, panel: str | None = None) -> None:
    """Draw the viewer at a simulated time [s] into a PNG file, without a window: all its panels, or
    the one of an entity, such as "world".

    Raises:
        Mistake: The viewer cannot start, has no such panel, or does not show the recording.
    """
    _check_png(png)
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


def _check_png(png: Path) -> None:
    """Refuse a PNG file that cannot or must not be written."""
    if not png.absolute().parent.is_dir():
        raise Mistake(f"{png}: there is no such folder to write to")
    if png.exists() and not png.is_file():
        raise Mistake(f"{png}: this is not a file; --png takes the file to write")
    check_suffix(png, ".png")


def _quiet_viewer() -> ViewerClient:
    """A viewer without a window, with its log kept away from our stderr."""
    stderr = os.dup(2)
    nothing = os.open(os.devnull, os.O_WRONLY)
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


BLOB = "EncodedImage:blob"
STRIPS = "LineStrips2D:strips"
FRAME = "frame"
TIME = "sim_time"
CORNERS = 4


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """One frame of a recording."""

    time: float
    """Simulated [s]."""
    image: Image
    """RGB (H, W, 3)."""
    truth: Array
    """Corners (4, 2) of the target [px]; nan if there are none."""
    estimate: Array
    """Corners (4, 2) of the estimate [px]; nan if there are none."""


def pictures(path: Path, count: int) -> list[RecordedFrame]:
    """Up to `count` frames at equal distances, including the first and the last.

    Raises:
        Mistake: The file is missing, not a recording, or damaged.
    """
    check(path)
    found: dict[str, dict[int, tuple[float, Any]]] = {BLOB: {}, "truth": {}, "estimate": {}}
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", "RRD file has no footer"
            )  # the frames before are read
            for name, frame, time, value in _logged(path):
                found[name][frame] = time, value
    except (RuntimeError, ValueError, OSError):
        raise Mistake(f"{path}: this recording is broken") from None
    frames = sorted(found[BLOB])
    if not frames:
        return []
    wanted = np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).astype(int))
    return [_recorded(found, frames[i], path) for i in wanted]


def _logged(path: Path) -> Iterator[tuple[str, int, float, Any]]:
    """Name (BLOB, truth or estimate), frame, time [s] and logged value of each."""
    names = {f"/{IMAGE}": (BLOB, BLOB)} | {
        f"/{IMAGE}/{who}": (who, STRIPS) for who in ("truth", "estimate")
    }
    for chunk in RrdReader(str(path)).stream():
        who, component = names.get(chunk.entity_path, ("", ""))
        batch = chunk.to_record_batch()
        if FRAME not in batch.schema.names or component not in batch.schema.names:
            continue
        times = batch.column(TIME).cast("int64").to_numpy() / 1e9
        for row, frame in enumerate(batch.column(FRAME).to_pylist()):
            yield who, frame, float(times[row]), batch.column(component)[row]


def _recorded(
    found: dict[str, dict[int, tuple[float, Any]]], frame: int, path: Path
) -> RecordedFrame:
    time, blob = found[BLOB][frame]
    raw = np.frombuffer(bytes(blob.as_py()[0]), np.uint8)
    image = cv2.imdecode(raw, cv2.IMREAD_COLOR)
    if image is None:
        raise Mistake(f"{path}: frame {frame} is not a picture")
    truth, estimate = (_corners(found[who].get(frame)) for who in ("truth", "estimate"))
    return RecordedFrame(
        time, cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.uint8), truth, estimate
    )


def _corners(logged: tuple[float, Any] | None) -> Array:
    """The rectangle of an outline: the first four points of its first line."""
    strips = None if logged is None else logged[1].as_py()
    return np.array(strips[0][:CORNERS]) if strips else np.full((CORNERS, 2), np.nan)
