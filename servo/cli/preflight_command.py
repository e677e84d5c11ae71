"""The command `servobench preflight`: compare a robot's log with the film of its camera, and print
what is wrong and what to change, before the robot moves by its camera.
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa
from rich.console import Console

from servo.cli.jobs import progress
from servo.cli.outputs import check_writable
from servo.cli.terminal import complain, plain, print_table, waiting
from servo.loop.episode import Episode
from servo.mistake import Mistake, as_mistake, check_suffix, writing
from servo.output.formats import Made, command_line
from servo.output.run_folder import prepare
from servo.output.versions import versions
from servo.report.page import render
from servo.scenario.calibration import camera_in
from servo.scenario.load import load
from servo.twin import section as sections
from servo.twin.commands import has_commands, of_commands
from servo.twin.compare import Comparison, compare, rough_begin
from servo.twin.corrections import Kind, Smooth, corrections
from servo.twin.mount import Mount
from servo.twin.readings import (
    SHORTEST,
    clock_of,
    command_log,
    film,
    hand_log,
    is_camera,
    log_table,
)
from servo.twin.still_tag import FEWEST, StillTag, TagSightings
from servo.twin.tracks import Tracks, follow
from servo.twin.verdict import MOUNT_OPTION, Finding, State, Trust, believed_mount
from servo.twin.wiggle import rates
from servo.types import DOF
from sim.types import Camera
from tracking.files import atomic
from tracking.sequences.bag_file import is_bag
from tracking.sequences.sources import Picture

PAGE = "report.html"
FARTHEST_MOUNT = 5.0
"""Largest coordinate of a stated mount [m]."""
ASSUMED = 60.0
"""Horizontal field of view of a camera of which nothing is known [deg]."""
RATE = 30.0
"""Rate of a folder of pictures for which none is given [Hz]."""
WHOLE = 0.99
"""A remark is printed if a smaller share of a film's pictures is within the log's time."""
PICTURES = 3600
"""Number of pictures that progress counts with where a film does not state its number."""


@dataclass(frozen=True, slots=True)
class Given:
    """The options of the commands `preflight` and `twin` about a robot's log and the film of its
    camera; None: not given.

    `log` and `video` are the log and the film, `scenario` is one whose robot has the log's joints.
    Of the camera there are its `calibration` file or horizontal field of view `fov` [deg], its
    stated pose in the hand, `mount` (x, y, z [m], roll, pitch, yaw [deg]), or only its distance
    `along` the optical axis from the hand's origin [m], its exposure, and the delay from its first
    to its last row (`readout_ms`) [ms]. With `eye_to_hand` the camera stands still and films what
    the hand carries, and `mount` is its pose in the frame of the robot's base.
    `rate` is that of a folder of pictures [Hz]; `topic`, `motion` and `commands` are the
    topics of a bag with the pictures, the hand's motion and the commanded twists; `stamps` is a CSV
    of the pictures' stamps, `begins` the time of the first picture on the log's clock [s], and
    `tag_mm` the side of a tag that stands still in the film [mm].
    """

    log: Path
    video: str
    scenario: str | None = None
    calibration: Path | None = None
    fov: float | None = None
    along: float | None = None
    """The camera's distance from the hand's origin along its optical axis [m]."""
    mount: list[float] | None = None
    """Stated pose of the camera in the hand, with `eye_to_hand` in the robot's base: x, y, z [m],
    roll, pitch, yaw [deg] about the fixed axes x, y, z."""
    exposure_ms: float | None = None
    readout_ms: float | None = None
    rate: float = RATE
    topic: str | None = None
    stamps: Path | None = None
    begins: float | None = None
    motion: str | None = None
    commands: str | None = None
    """Topics of a bag with the hand's motion and the commanded twists."""
    eye_to_hand: bool = False
    """True if the camera stands still and films what the hand carries."""
    tag_mm: float | None = None
    """Side of the black square of an AprilTag 36h11 that stands still in the film [mm]."""

    @property
    def late(self) -> float:
        """Time from the middle of a picture's exposure (middle row) to the end of its last row's,
        as far as it is known [s].
        """
        return ((self.exposure_ms or 0.0) + (self.readout_ms or 0.0)) / 2e3

    @staticmethod
    def of(log: Path | None, video: str | None, **options: object) -> "Given":
        """Return the options of a command. The log may be a bag, which has the film, too; `video`
        may then be None.

        Raises:
            Mistake: There is no log, or no film; a coordinate of the stated mount is above 5 m; or
                the camera's distance along its axis is given beside its focal length.
        """
        if log is not None and video is None and is_bag(log):
            video = str(log)
        if log is None or video is None:
            raise Mistake(
                "give a LOG and a VIDEO, or a bag with both; `servobench preflight --wiggle "
                "FILE.csv` writes the motion to record"
            )
        given = Given(log, video, **options)  # type: ignore[arg-type]
        if given.along is not None and (given.fov is not None or given.calibration is not None):
            raise Mistake(
                "--along has no effect where --fov or --calibration gives the focal length, as the "
                "film then shows this distance: leave --along out"
            )
        farthest = max((given.mount or [0.0])[:3], key=abs)
        if abs(farthest) > FARTHEST_MOUNT:
            origin = "base" if given.eye_to_hand else "hand"
            raise Mistake(
                f"--mount: {farthest:g} m is too far from the {origin}, at most "
                f"{FARTHEST_MOUNT:g}: give x, y, z in m"
            )
        return given

    def table(self) -> pa.Table:
        """Return the rows of the log.

        Raises:
            Mistake: The log cannot be read, or `motion` or `commands` are given for a log that is
                not a bag.
        """
        return log_table(self.log, self.scenario, self.motion, self.commands)

    @property
    def stated_by(self) -> str:
        """What states the camera's mount, in words."""
        if self.mount is not None:
            return MOUNT_OPTION
        if self.eye_to_hand:
            return "camera.pose"
        return "the log's camera poses" if self.scenario is None else "the scenario's mount"


def run(
    log: Path | None, video: str | None, wiggle: Path | None, out: Path | None, **options: object
) -> int:
    """Compare a robot's log with the film of its camera; print a table of what is wrong, and write
    it as a page. Or write the motion that the robot should play for such a recording.

    Args:
        log: The robot's log; None only with `wiggle`.
        video: The film of its camera; None only with `wiggle`.
        wiggle: A CSV file to write the motion into, in place of a comparison; None: compare.
        out: The folder to write; None: the next free runs/preflight-LOG.
        **options: The other fields of `Given`, by name.

    Returns:
        The exit code: 1 if something is wrong or refused (too uncertain to be stated), else 0.

    Raises:
        Mistake: The log or the film is missing or cannot be used, an option does not fit them, or a
            file cannot be written.
        Refused: The disk is full or fails.
    """
    scenario = options.get("scenario")
    if wiggle is not None:
        write_wiggle(wiggle, scenario if isinstance(scenario, str) else None)
        return 0
    given = Given.of(log, video, **options)
    if given.scenario is not None:
        load(given.scenario)  # a log of the hand does not need it, but the next command does
    compared, *_ = comparison(given, given.table())
    show(compared)
    folder = prepare(out, f"preflight-{given.log.stem}")
    with writing(folder):
        page = atomic.write(folder, PAGE, render([sections.section(compared, folder, made(given))]))
    plain(Console(), str(page), after(compared, f"{made(given, 'twin').command} --on SCENARIO"))
    return 0 if compared.verdict.is_good else 1


def after(compared: Comparison, command: str) -> str:
    """Return a sentence about what to do after a comparison of log and film: run a command, or
    record again.
    """
    verdict = compared.verdict
    if verdict.is_good:
        return f"{verdict.summary}. Next: {command}"
    if verdict.is_enough:
        return "not ready: give what is asked for above, with the same recording"
    return "not ready: correct what is wrong, or refused, and record again"


def made(given: Given, command: str = "preflight", **more: object) -> Made:
    """Return what a page says about how it was made: the command line that repeats a comparison,
    and the versions of the packages.

    Args:
        given: The options about log, film and camera.
        command: Name of the command, "preflight" or "twin".
        **more: Further options of the command line.
    """
    options = {
        name: getattr(given, name)
        for name in (
            "scenario",
            "calibration",
            "fov",
            "along",
            "exposure_ms",
            "readout_ms",
            "rate",
            "topic",
            "stamps",
            "begins",
            "motion",
            "commands",
            "eye_to_hand",
            "tag_mm",
        )
    }
    if given.rate == RATE:
        del options["rate"]
    if given.mount is not None:
        options["mount"] = ",".join(f"{each:g}" for each in given.mount)
    line = command_line(command, str(given.log), given.video, **options, **more)
    return Made(command=line, versions=versions())


def show(compared: Comparison) -> None:
    """Print the table of a comparison of log and film, and a line for each doubt about it."""
    console = Console()
    print_table(console, sections.table(compared))
    plain(console, *(f"doubt: {each}" for each in compared.verdict.doubts))


def comparison(given: Given, table: pa.Table) -> tuple[Comparison, Camera, float]:
    """Return the comparison of a robot's log, given as its table, with the film of its camera, the
    film's camera, and the time of the film's first picture on the log's clock [s], to which the
    offset that the comparison estimates is not yet added.

    Raises:
        Mistake: The log or the film cannot be used, or an option does not fit them.
    """
    console = Console()
    with waiting(Console(stderr=True), "reading the log"):
        smooth = hand_log(table, given.log, given.scenario).smooth
    is_in_hand = given.mount is not None and not given.eye_to_hand
    if is_in_hand and is_camera(table, given.log, given.scenario):
        raise Mistake(
            f"--mount: {given.log} has the camera's own poses (columns camera_..., or joints with "
            "--scenario), in which the mount should be zero: leave --mount out"
        )
    if given.eye_to_hand:
        smooth = replace(smooth, is_inverse=True)
        if smooth.kind is Kind.TWISTS:
            raise Mistake(
                f"{given.log}: --eye-to-hand needs poses of the hand or joints: twists do not show "
                "where the base is, in which the camera stands"
            )
        if given.tag_mm is not None:
            raise Mistake(
                "--tag-mm needs a camera that moves past a tag that stands still: leave out "
                "--tag-mm or --eye-to-hand"
            )
    sightings = TagSightings()
    tracks, camera, stamped = followed(given, smooth, console, sightings)
    trust = Trust(
        given.calibration is not None or given.fov is not None,
        given.along,
        stated_mount(given, table),
        given.late,
        _tag(given, sightings, camera),
        stamped,
        given.stated_by,
        is_relative=given.mount is None and not given.eye_to_hand,
    )
    with progress(console, "comparing", 1 + len(corrections(smooth))) as tick:
        compared = compare(smooth, tracks, trust, tick)
    return _with_commands(compared, given, table), camera, float(tracks.times[0])


AS_LOGGED = Finding(
    "commands",
    "they do not fit the logged motion, but this is wrong itself (see the row mistake)",
    "correct the log's motion, and compare again: only then the commands can be judged",
    State.UNKNOWN,
)


def _with_commands(compared: Comparison, given: Given, table: pa.Table) -> Comparison:
    """Return a comparison of log and film with rows about the log's commands."""
    verdict = compared.verdict
    mistakes: list[str] = []
    if not has_commands(table):
        why = "the log has no columns command_..."
        rows = [Finding("commands", why, state=State.UNKNOWN)]
    else:
        hand = compared.motion.inverse if given.eye_to_hand else compared.motion
        try:
            rows, mistakes = of_commands(command_log(table, given.log, hand))
            # The commands are compared with the motion as it was logged.
            if verdict.mistakes and any(row.state is State.WRONG for row in rows):
                rows, mistakes = [AS_LOGGED], []
        except Mistake as error:
            text = str(error).removeprefix(f"{given.log}: ")
            rows = [Finding("commands", text, state=State.UNKNOWN)]
    verdict = replace(
        verdict,
        findings=[*verdict.findings, *rows],
        mistakes=[*verdict.mistakes, *mistakes],
    )
    return replace(compared, verdict=verdict)


def _tag(given: Given, seen: TagSightings, camera: Camera) -> StillTag | None:
    """Return the tag of a film; None if the user states no tag.

    Raises:
        Mistake: The tag is seen in too few pictures.
    """
    if given.tag_mm is None:
        return None
    if len(seen.numbers) < FEWEST:
        raise Mistake(
            f"{given.video}: an AprilTag 36h11 is seen in {len(seen.numbers)} pictures of this "
            f"film (each third one is searched), and {FEWEST} are needed: leave out --tag-mm, or "
            "record with the tag in view"
        )
    return StillTag.of(seen, camera, given.tag_mm / 1e3)


def stated_mount(given: Given, table: pa.Table) -> Mount | None:
    """Return the stated mount: the pose of the camera in the robot's hand, or, if the camera stands
    still (eye-to-hand), in the base's frame. None: nothing states it.

    It is the one that the user states, if there is one. Otherwise, for a camera that stands still,
    it is the pose in the room of the scenario's camera, if that stands still, too; for a camera in
    the hand it is zero if the log has the camera's own poses, or a robot's joints with --scenario.

    Args:
        given: The options about log, film and camera.
        table: The rows of the log.
    """
    if given.mount is not None:
        return believed_mount(tuple(given.mount))
    if given.eye_to_hand:
        camera = None if given.scenario is None else load(given.scenario).camera
        if camera is None or camera.mounted != "world":
            return None
        return believed_mount(camera.pose)
    is_stated = is_camera(table, given.log, given.scenario)
    return believed_mount((0.0,) * 6) if is_stated else None


def followed(
    given: Given, smooth: Smooth, console: Console, sightings: TagSightings
) -> tuple[Tracks, Camera, bool]:
    """Return the image points that were followed through a film, the film's camera, and whether the
    film's own stamps are on the log's clock (False also if the user states when the film begins).
    The points' times are on the log's clock, but for an offset that is not yet known. Of a camera
    that stands still (eye-to-hand), only the points that move are returned.

    Args:
        given: The options about log, film and camera.
        smooth: The smoothed log, used to place a film without stamps of the log's clock.
        console: The output of the command, for progress and remarks.
        sightings: Gets the pictures in which a tag is seen, if the user states one.

    Raises:
        Mistake: The film cannot be used.
    """
    source, pictures = film(given.video, given.rate, given.topic, given.stamps)
    first = next(pictures, None)
    if first is None:
        raise Mistake(f"{given.video}: this film has no pictures: give another one")
    whole: Iterable[Picture] = chain([first], pictures)
    if given.tag_mm is not None:
        whole = sightings.watching(whole)
    with progress(console, "following points", source.count or PICTURES) as tick, as_mistake():
        tracks = follow(whole, lambda w, h: camera_for(given, w, h), tick)
    if source.end is not None:
        complain(source.end.sentence)
    span = float(tracks.times[-1] - tracks.times[0])
    if span < SHORTEST:
        raise Mistake(
            f"{given.video}: this film is {span:.6g} s long: record {SHORTEST:g} s or more, best "
            "30 s of the motion that --wiggle writes"
        )
    if not len(tracks.first):
        raise Mistake(
            f"{given.video}: no points can be followed in this film: record a well lit scene with "
            "texture, in focus"
        )
    clock = clock_of(first.stamp, smooth, given.begins)
    begins = clock.begins - given.late
    if not clock.is_known:
        begins = rough_begin(smooth, tracks)
        plain(
            console,
            f"the film has no stamps on the log's clock: its first picture is taken to be at "
            f"{begins:.3f} s of the log, where the motion fits best",
        )
    tracks = tracks.moving if given.eye_to_hand else tracks
    timed = replace(
        tracks, times=tracks.times + begins, cuts=[time + begins for time in tracks.cuts]
    )
    inside = np.mean((timed.times > smooth.times[0]) & (timed.times < smooth.times[-1]))
    if inside < WHOLE:
        plain(
            console,
            f"{100 * inside:.0f} % of the film is inside the log's time; the rest is left out",
        )
    return timed, camera_for(given, *tracks.size), clock.is_known and given.begins is None


def camera_for(given: Given, width: int, height: int) -> Camera:
    """Return the camera [px] for the pictures of a film: that of the calibration file, or a pinhole
    camera without distortion with the horizontal field of view of `given` [deg], or of 60 deg.

    Args:
        given: The options about log, film and camera.
        width: Width of the film's pictures [px].
        height: Height of the film's pictures [px].

    Raises:
        Mistake: The calibration cannot be read, or is for another size.
    """
    if given.calibration is not None:
        camera = camera_in(given.calibration)
        if (camera.width, camera.height) != (width, height):
            raise Mistake(
                f"{given.calibration}: this calibration is for {camera.width} x {camera.height} "
                f"px, and the film has {width} x {height} px: give the calibration of this film"
            )
        return camera
    focal = width / 2 / float(np.tan(np.radians(given.fov or ASSUMED) / 2))
    return Camera(focal, focal, width / 2, height / 2, width, height)


def write_wiggle(path: Path, scenario: str | None) -> None:
    """Write the motion that a robot should play for a pre-flight, 30 s of slow swings, as a CSV of
    rates at 50 Hz [m/s, rad/s], and print how far each axis moves.

    Args:
        path: The file to write; it must not exist.
        scenario: The scenario whose robot's joints are moved; None: the components of the hand's
            twist.

    Raises:
        Mistake: The scenario is wrong, or the file exists, does not end in .csv or cannot be
            written.
        Refused: The disk is full or fails.
    """
    check_suffix(path, ".csv")
    check_writable(path)
    names, units = DOF, ("m", "m", "m", "rad", "rad", "rad")
    if scenario is not None:
        with Episode(load(scenario), seen=False) as episode:
            names, units = episode.world.robot.names, episode.world.robot.units
    times, values = rates(tuple(units))
    with writing(path, "this file"), path.open("w", newline="") as file:
        writer = csv.writer(file)
        ends = [f"command_{name}_{unit}_s" for name, unit in zip(names, units, strict=True)]
        writer.writerow(["time_s", *ends])
        for time, row in zip(times.tolist(), values.tolist(), strict=True):
            writer.writerow([f"{time:.3f}", *(f"{each:.6f}" for each in row)])
    most = np.ptp(np.cumsum(values, axis=0), axis=0) / 50
    spans = ", ".join(
        f"{name} {1e3 * span:.0f} mm" if unit == "m" else f"{name} {np.degrees(span):.1f} deg"
        for name, unit, span in zip(names, units, most, strict=True)
    )
    plain(
        Console(),
        f"{path}: {times[-1]:.0f} s of rates, from rest to rest, where it began; it moves by "
        f"{spans}. Try it slowly first, with room around the robot.",
    )
