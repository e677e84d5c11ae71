"""The table [recording] of a scenario: recorded pictures of a real scene, from which the pictures
of the run's camera are cut out. This camera only turns, on a pan-tilt head.
"""

from dataclasses import dataclass
from functools import partial
from math import atan2, degrees, hypot, radians
from typing import Annotated, Literal

import mujoco
import numpy as np
from annotated_types import Ge, Le

from servo.mistake import Mistake
from servo.scenario.fill import WrongSetting, fill
from servo.scenario.toml import Table, is_number, is_table
from sim.camera.camera import CameraConfig, camera_of
from sim.camera.renderer import MakeRenderer
from sim.models.target import Target
from sim.ranges import LONGEST, File, FileOrFolder
from sim.recording.recorded import Recorded, RecordedMotion
from sim.recording.renderer import RecordingRenderer
from sim.recording.room import Range, room_in, turned
from sim.types import Camera
from tracking.sequences.sources import RATE

SECTION = "recording"
FOV = 60.0
"""Horizontal field of view of a recording camera that nothing states [deg]."""
SAME_SIZE = 1e-3
"""Share by which pictures may be enlarged without a remark."""
LEAST = 640, 480
"""Width and height [px] that a recording's pictures have at least after scaling: see `scale_of`."""
MARGIN = 0.98
"""Share of the ranges of pan and tilt in which the run starts."""
SLACK = 1e-6
"""A run may be longer than its recording by less than this [s]."""
MOVES = ("motion", "target")
"""Tables of parts that the recording replaces."""
VIEW = ("fovy_deg", "fx", "fy", "cx", "cy", "calibration")
"""Settings of [camera] that give the view's focal length."""


@dataclass(frozen=True, slots=True)
class RecordingConfig:
    """Settings of a recorded scene in which a run's camera turns: pictures, rate, truth, lens."""

    pictures: FileOrFolder = ""
    """A folder of pictures, a video file or a bag, as `servobench track` reads them, or a shipped
    recording's name; by default there is none, and the room is drawn."""
    truth: File = ""
    """File with the target's box or corners in each picture; by default the one with a usual name
    in the folder, or beside the video."""
    truth_format: Literal["auto", "otb", "vot", "tld", "csv"] = "auto"
    """Format of the truth file, where its name and header do not decide it."""
    rate: Annotated[float, Ge(0.5), Le(1000)] = RATE
    """Rate of a folder's pictures [1/s]; videos and bags have their own."""
    fov_deg: Annotated[float, Ge(1), Le(150)] | None = None
    """Horizontal field of view of the recording camera [deg]; without it and a calibration 60, and
    a line says so."""
    calibration: File = ""
    """Calibration file of the recording camera, of ROS or OpenCV; by default camera.yaml in the
    folder, or the file beside the video with its name and the suffix .yaml."""

    def __post_init__(self) -> None:
        """Check that the lens is given once.

        Raises:
            ValueError: `fov_deg` and `calibration` are both given.
        """
        if self.calibration and self.fov_deg is not None:
            raise ValueError("fov_deg and calibration both give the lens; leave one out")

    def renderer(self) -> MakeRenderer | None:
        """Return a function that makes the renderer of a run, whose pictures are cut out of the
        recording in the direction in which the camera looks; None if the settings name no
        recording.

        Raises:
            Mistake: The recording cannot be read.
        """
        return partial(RecordingRenderer, recorded_of(self)) if self.pictures else None

    def remarks(self, focal: float) -> list[str]:
        """Return sentences for the user: one if the recording's field of view is taken to be 60
        degrees because nothing gives it, and one if its pictures are enlarged for the run. The list
        is empty if neither holds, or without a recording.

        Args:
            focal: Focal length of the run's camera [px].

        Raises:
            Mistake: The recording cannot be read.
        """
        if not self.pictures:
            return []
        from servo.scenario import recorded_files  # PyAV: only for a recording

        camera = recorded_of(self).camera
        said = list[str]()
        if recorded_files.is_lens_assumed(self):
            said.append(
                f"the recording's field of view is taken to be {FOV:g} deg: set recording.fov_deg "
                "or recording.calibration"
            )
        if (factor := focal / camera.focal) > 1 + SAME_SIZE:
            said.append(
                f"the recording has {camera.width} x {camera.height} px: its pictures are enlarged "
                f"{factor:.3g} times"
            )
        return said


@dataclass(frozen=True)
class MovedByRecording:
    """Settings of the motion of a recorded target: the recording, whose truth file gives the
    motion.
    """

    kind = "recorded"
    recording: RecordingConfig

    def build(self, rng: np.random.Generator) -> RecordedMotion:
        """Return the motion of the target in the recording; `rng` is not used.

        Raises:
            Mistake: The recording cannot be read.
        """
        return recorded_of(self.recording).motion()


@dataclass(frozen=True)
class ShownByRecording:
    """Settings of a recorded target: the recording, whose pictures alone show the target, so that
    no model of it is drawn.
    """

    kind = "recorded"
    recording: RecordingConfig

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target of the recording; `rng` is not used.

        Raises:
            Mistake: The recording cannot be read.
        """
        return recorded_of(self.recording).target()


def recorded_parts(config: RecordingConfig) -> dict[str, object]:
    """Return the settings of the motion and of the target of a recording, under the keys "motion"
    and "target"; an empty dictionary if the settings name no recording.
    """
    if not config.pictures:
        return {}
    return {"motion": MovedByRecording(config), "target": ShownByRecording(config)}


def with_recording(table: Table, place: str) -> Table:
    """Return a scenario's table in which a recording gives those settings of camera, run, robot,
    world and start that the user left out: the recording's rate, duration and focal length, a
    pan-tilt head as the robot, whose ranges end where the picture would leave the recording,
    world.visibility = true (each frame says whether the recording shows the target), and a start at
    which the camera looks at the target. camera.renderer = "recording" is set in any case.

    Args:
        table: The scenario's table, which is not changed; it is returned as it is if it names no
            recording.
        place: The scenario's file, or the option that names the recording, for messages.

    Raises:
        Mistake: The recording cannot be read, or a setting does not fit it.
    """
    given = table.get(SECTION)
    if not is_table(given) or not given.get("pictures"):
        return table
    for name in MOVES:
        if table.get(name):
            raise Mistake(f"{place}: the recording gives the {name}: leave [{name}] out")
    config: RecordingConfig = fill(RecordingConfig, given, SECTION)
    recorded = recorded_of(config)
    camera = _camera(_section(table, "camera"), recorded)
    view = _view(camera)
    room = room_in(recorded.camera, view)
    if room is None:
        raise Mistake(
            f"{place}: the view of {view.width} x {view.height} px reaches beyond the recording: "
            "set a longer focal length (a larger camera.fx, or a smaller camera.fovy_deg), or, "
            "without camera.fovy_deg, a smaller camera.width and camera.height"
        )
    robot = _section(table, "robot")
    if robot.get("kind", "head") != "head":
        raise Mistake(
            f'{place}: in a recording the camera can only turn: leave robot.kind out, or set "head"'
        )
    pan, tilt = map(list, room)
    return table | {
        "camera": camera,
        "run": _section(table, "run") | {"duration": _duration(recorded, table, place)},
        "robot": {"kind": "head", "pan": pan, "tilt": tilt} | robot,
        "world": {"visibility": True} | _section(table, "world"),
        "start": _start(recorded, view, room) | _section(table, "start"),
    }


def _section(table: Table, name: str) -> Table:
    """Return the table with a name inside a scenario's table; an empty table if it is missing.

    Raises:
        WrongSetting: Something other than a table has this name.
    """
    found = table.get(name, {})
    if not is_table(found):
        raise WrongSetting(f"{name} should be a table of settings, not {found!r}", name)
    return found


def _camera(given: Table, recorded: Recorded) -> Table:
    """Return the table [camera] of a run in a recording: its rate and, if the user has set nothing
    that gives the focal length, a view whose pixels are those of the recording, scaled to at least
    `LEAST` pixels.

    Raises:
        Mistake: The camera has depth pictures, or stands in the room.
    """
    if given.get("depth"):
        raise Mistake("camera.depth: a recording has no depth pictures: leave camera.depth out")
    if given.get("mounted", "robot") != "robot":
        raise Mistake("camera.mounted: in a recording the robot carries the camera: leave it out")
    rate = 1 / float(np.median(np.diff(recorded.times))) if len(recorded.times) > 1 else RATE
    usual: Table = {"rate": round(rate, 6)}
    if not any(name in given for name in VIEW):
        usual["fx"] = recorded.camera.focal * scale_of(recorded.camera)
    return usual | given | {"renderer": SECTION}


def _view(camera: Table) -> Camera:
    """Return the intrinsics that a table [camera] gives."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_camera(name=SECTION)
    return camera_of(fill(CameraConfig, camera, "camera"), spec.compile(), SECTION)


def scale_of(camera: Camera) -> float:
    """Return the factor by which the pictures of a recording are enlarged for a run: the smallest
    one that makes them at least 640 px wide and 480 px high; below 1 for larger ones.

    Args:
        camera: The recording camera, with the size of its pictures [px].
    """
    return max(LEAST[0] / camera.width, LEAST[1] / camera.height)


def _duration(recorded: Recorded, table: Table, place: str) -> float:
    """Return the duration of a run [s]: the user's, or that of the recording, but at most
    `LONGEST`.

    Raises:
        Mistake: The recording is shorter than the user's duration, which is a number.
    """
    times = recorded.times
    most = float(times[-1] + np.median(np.diff(times))) if len(times) > 1 else 1 / RATE
    asked = _section(table, "run").get("duration")
    if asked is None:
        return min(most, LONGEST)
    if not is_number(asked):
        raise WrongSetting(
            f"run.duration should be a number of seconds, not {asked!r}", "run.duration"
        )
    if asked > most + SLACK:
        raise Mistake(
            f"{place}: run.duration = {asked:g} s is too long: set at most {most:.4g} s, which the "
            "recording lasts"
        )
    return asked


def _start(recorded: Recorded, view: Camera, room: tuple[Range, Range]) -> Table:
    """Return x and y [px] of the table [start], the target's distances to the right of and below
    the middle of the view. With them the camera looks at the target in the first picture, as nearly
    as the recording allows.
    """
    x, y = recorded.camera.normalise(recorded.corners[0]).mean(axis=0)
    wanted = degrees(atan2(x, 1)), degrees(-atan2(y, hypot(x, 1)))
    turns = [
        radians(float(np.clip(turn, MARGIN * low, MARGIN * high)))
        for turn, (low, high) in zip(wanted, room, strict=True)
    ]
    seen = view.project(turned(*turns).T @ (x, y, 1.0))
    return dict(zip("xy", (seen - (view.width / 2, view.height / 2)).tolist(), strict=True))


def recorded_of(config: RecordingConfig) -> Recorded:
    """Return the recording that settings name: its pictures, the target's true corners in them [px]
    and the intrinsics of its camera, as they are on the disk now.

    Raises:
        Mistake: Pictures, truth or calibration cannot be read or do not fit each other, or the
            target is not in the first picture.
    """
    from servo.scenario import recorded_files  # PyAV: only for a recording

    return recorded_files.read(config)
