"""Reads the recording of a real scene that a scenario's table [recording] names: its pictures, the
target's true corners in them, and its camera.
"""

import functools
from dataclasses import dataclass
from math import radians, tan
from pathlib import Path

import numpy as np

from servo.mistake import Mistake, as_mistake
from servo.scenario.calibration import camera_in
from servo.scenario.recording import FOV, RecordingConfig
from sim.files.shipped import file_of
from sim.outline import area
from sim.recording.recorded import Recorded, Shown
from sim.types import Array, Camera
from tracking.sequences import sequence
from tracking.sequences import truth as truths
from tracking.sequences.sources import Folder, Picture, Source
from tracking.sequences.stream import ADDRESS, shown
from tracking.sequences.truth import Format
from tracking.sequences.video_file import Video

FOLDER = "recordings"
"""Folder of the shipped recordings in `scenes`."""


def read(config: RecordingConfig) -> Recorded:
    """Return the recording that settings name, as it is on the disk now. It is cached until the
    time of change of its video file or folder, its truth or its calibration differs; a changed
    picture in a folder is not noticed.

    Raises:
        Mistake: The first picture, truth or calibration cannot be read, the three do not fit each
            other, or the target is not in the first picture.
    """
    with as_mistake():
        path = _path(config.pictures)
        truth = Path(config.truth) if config.truth else _truth_beside(path)
        if truth is None:
            raise ValueError(
                f"{path}: there is no truth file in it or beside it, with the target's box in each "
                "picture: set recording.truth"
            )
        lens = _calibration(config, path)
        files = [each.resolve() for each in (path, truth, lens or truth)]
        stamps = tuple(each.stat().st_mtime_ns for each in files if each.exists())
        return _recorded(config, *files[:2], lens and lens.resolve(), stamps)


def is_lens_assumed(config: RecordingConfig) -> bool:
    """Return True if the field of view of the recording camera is an assumption: neither the
    settings nor a calibration file give it.

    Raises:
        Mistake: `pictures` names a camera or a stream, or is a bare name that is neither a file, a
            folder nor a shipped recording.
    """
    with as_mistake():
        return config.fov_deg is None and _calibration(config, _path(config.pictures)) is None


def _path(pictures: str) -> Path:
    """Return the path of a recording.

    Raises:
        ValueError: `pictures` names a camera or a stream, or is a bare name that is neither a file,
            a folder nor a shipped recording.
    """
    if ADDRESS.match(pictures) or pictures.startswith(sequence.CAMERA):
        raise ValueError(
            f"{shown(pictures)}: a camera or stream cannot be read again: record it first"
        )
    path = Path(pictures)
    return path if path.is_dir() else file_of(pictures, FOLDER, ".mp4", "recording.pictures")


def _calibration(config: RecordingConfig, path: Path) -> Path | None:
    """Return the calibration file of a recording's camera: the one that the settings name, else
    camera.yaml in its folder, or the one beside a video with the video's name. None without one, or
    if the settings give the field of view instead.
    """
    if config.calibration:
        return Path(config.calibration)
    beside = path / "camera.yaml" if path.is_dir() else path.with_suffix(".yaml")
    return beside if config.fov_deg is None and beside.is_file() else None


def _truth_beside(path: Path) -> Path | None:
    """Return the truth file in a recording's folder or beside a video, if it has a usual name;
    else None.

    Raises:
        ValueError: The folder has several truth files, or cannot be read.
    """
    if path.is_dir():
        return sequence.truth_of(str(path))
    beside = (path.with_suffix(suffix) for suffix in (".csv", ".txt"))
    return next((each for each in beside if each.is_file()), None)


@functools.lru_cache(maxsize=16)
def _recorded(
    config: RecordingConfig, path: Path, truth: Path, lens: Path | None, changed: tuple[int, ...]
) -> Recorded:
    """Return a recording. It is cached until a file's time of change `changed` [ns] differs.

    Raises:
        ValueError: As for `read`.
    """
    del changed
    source = sequence.source_of(str(path), config.rate)
    form = Format.named(config.truth_format)
    corners = truths.read(truth, form, source.count)
    sequence.check_truth(corners, source, str(truth), form)
    if not np.isfinite(corners[0]).all():
        raise ValueError(
            f"{truth}: the target is not in the first picture: leave out the pictures and lines "
            "before it appears"
        )
    if not area(corners[0]) > 0:
        raise ValueError(
            f"{truth}: the target's outline in the first picture has no area: correct it"
        )
    times = _times(source)
    if len(times) < len(corners):
        raise ValueError(
            f"{path}: this recording breaks off after {len(times)} of {len(corners)} pictures: "
            "leave out the rest of the truth, or repair the file"
        )
    first = next(iter(source), Picture("", 0.0, None))
    if first.image is None:  # a tracker would learn a black picture in its place
        raise ValueError(
            f"{path}: the first picture cannot be read ({first.reason}): leave out the pictures "
            "and lines before the first one that can be read"
        )
    height, width = first.image.shape[:2]
    return Recorded(
        _intrinsics(config, lens, width, height), times[: len(corners)], corners, _Pictures(source)
    )


@dataclass(frozen=True)
class _Pictures:
    """Reads the pictures of a source, from the first one, each time that it is called."""

    source: Source

    def __call__(self) -> Shown:
        """Yield the time [s] and the image of each picture."""
        for picture in self.source:
            yield picture.time, picture.image


def _times(source: Source) -> Array:
    """Return the times (n,) of a source's pictures [s]; those of a video by its packets, without
    decoding.
    """
    if isinstance(source, Folder):
        return np.arange(len(source.files)) / source.rate
    if isinstance(source, Video):
        return source.times()
    return np.array([picture.time for picture in source])


def _intrinsics(config: RecordingConfig, lens: Path | None, width: int, height: int) -> Camera:
    """Return the recording camera, by its calibration file `lens` or its field of view.

    Raises:
        Mistake: The file cannot be read, or is of pictures of another size.
    """
    if lens is None:
        f = width / 2 / tan(radians(config.fov_deg or FOV) / 2)
        return Camera(f, f, width / 2, height / 2, width, height)
    camera = camera_in(lens)
    if (camera.width, camera.height) != (width, height):
        raise Mistake(
            f"{lens}: this calibration is for {camera.width} x {camera.height} px, and the "
            f"recording has {width} x {height} px: give the calibration of this recording"
        )
    return camera
