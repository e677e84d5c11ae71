"""Reader of the camera's pictures in the Rerun recording of a run, with the target's true and
estimated corners.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from servo.mistake import Mistake
from servo.output.formats import RUN_AGAIN
from servo.output.recording.layout import IMAGE
from servo.output.recording.view import check
from sim.files.picture_file import decoded
from sim.types import Array, Image

BLOB = "EncodedImage:blob"
STRIPS = "LineStrips2D:strips"
"""Rerun's names of the logged values."""
FRAME = "frame"
TIME = "sim_time"
"""Timelines of a recording."""
CORNERS = 4
"""Points of an outline that are its rectangle; the others draw its front."""


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """One picture in the recording of a run: simulated time [s], RGB picture (H, W, 3), and true
    and estimated corners (4, 2) of the target [px], nan if they were not logged.
    """

    time: float
    """Simulated time [s]."""
    image: Image
    """RGB (H, W, 3)."""
    truth: Array
    """True corners (4, 2) of the target [px]; nan if they were not logged."""
    estimate: Array
    """Estimated corners (4, 2) of the target [px]; nan if they were not logged."""


def pictures(path: Path, count: int) -> list[RecordedFrame]:
    """Return up to `count` pictures in the recording of a run, evenly spaced from the first to the
    last. The list is empty for a recording without such pictures, as that of a track is.

    Raises:
        Mistake: The file is missing, is no recording, or is damaged.
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
        raise Mistake(f"{path}: this recording is damaged: {RUN_AGAIN}") from None
    frames = sorted(found[BLOB])
    if not frames:
        return []
    wanted = np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).astype(int))
    return [_recorded(found, frames[i], path) for i in wanted]


def _logged(path: Path) -> Iterator[tuple[str, int, float, Any]]:
    """Yield all logged pictures and outlines as (name, frame number, time [s], value); the name is
    `BLOB` for a picture, else "truth" or "estimate".
    """
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
    try:
        image = decoded(bytes(blob.as_py()[0]))
    except ValueError:
        raise Mistake(
            f"{path}: this recording is damaged (the picture of frame {frame} cannot be decoded): "
            f"{RUN_AGAIN}"
        ) from None
    truth, estimate = (_corners(found[who].get(frame)) for who in ("truth", "estimate"))
    return RecordedFrame(time, image, truth, estimate)


def _corners(logged: tuple[float, Any] | None) -> Array:
    """Return the corners (4, 2) [px] of a logged outline; nan if none was logged."""
    strips = None if logged is None else logged[1].as_py()
    return np.array(strips[0][:CORNERS]) if strips else np.full((CORNERS, 2), np.nan)
