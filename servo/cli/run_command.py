"""The command `servobench run`: run one scenario and write its results into a folder."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from dataclasses import replace
from math import degrees, radians
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from servo.cli.idle_settings import idle_settings, reports_corners
from servo.cli.outputs import Outputs, announce, linger
from servo.cli.terminal import (
    COMPILING,
    WAITING,
    escape,
    plain,
    print_table,
    progress_bar,
    waiting,
)
from servo.closing import closing
from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.events import remarks_on_tracker
from servo.loop.measure import MEASURES, pose_measures
from servo.loop.part_failures import PartFailed
from servo.loop.run_measures import Outcome, timed
from servo.loop.settings import DOES_NOT_REPEAT, Setup
from servo.loop.step import DOF
from servo.mistake import Refused
from servo.output.formats import command_line
from servo.output.run_folder import RECORDING, RunFolder, discard, prepare, with_traceback
from servo.report.words import Table, shown
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from servo.scenario.part_names import changes_of
from servo.study.bounds import doubts_of, missed_lines, unjudged
from servo.study.run import Job, Record
from servo.study.run_report import RunReport
from servo.study.scenario_run import LoadedScenario, record_of
from sim.camera import gl
from sim.kinds import kind_of
from sim.kinematics.doubts import doubts
from sim.outline import Outline
from sim.types import Array
from tracking.advice import advice
from tracking.guests.guest import GuestSettings
from tracking.types import traits_of

if TYPE_CHECKING:
    from servo.ros2.server import Server

HIDDEN = 0.1
"""The target counts as hidden if a smaller share of it is visible."""
START_NEAR = 1e-3
START_TURNED = radians(1.0)
"""Largest distance and angle from the start pose at which the robot counts as there [m, rad]."""
TELLING = ("servo_rms_px", "servo_peak_px", "tracking_rms_px")
"""Measures that are printed for a scenario without bounds."""


def run(
    scenario: str,
    changes: Sequence[str],
    seed: int | None,
    out: Path | None,
    tracker: str | None = None,
    controller: str | None = None,
    quiet: bool = False,
    no_rerun: bool = False,
    ros2: bool = False,
    all_measures: bool = False,
    **shown: Any,
) -> int:
    """Run one scenario, write its results into a folder, and print how it went, where the results
    are, and what to do next.

    Args:
        scenario: A shipped scenario or a TOML file.
        changes: Changes of settings, such as "run.duration=5".
        seed: Seed of the random streams; None: that of the scenario.
        out: The folder to write; None: the next free runs/NAME-SEED.
        tracker: The tracker as on the command line, such as "kams:paper"; None: the scenario's.
        controller: The control law as on the command line; None: the scenario's.
        quiet: Whether to print on stderr only: mistakes and missed bounds.
        no_rerun: Whether to write no Rerun recording.
        ros2: Whether a controller in ROS 2 moves the camera.
        all_measures: Whether to print every measure and the times of a step, too.
        **shown: Options for films, logs and viewers: the fields of `Outputs`, by name.

    Returns:
        The exit code: 1 if a bound was missed, else 0.

    Raises:
        Mistake: The scenario or a setting is wrong, a component failed, or the folder cannot be
            used.
        Refused: A file could not be written completely; the table of steps has priority.
    """
    outputs = Outputs(**shown)
    if ros2:
        from servo.ros2.server import Server

        outputs = replace(outputs, server=Server())
    changes = [*changes_of(tracker, controller), *changes]
    loaded = load(scenario, changes, seed, outputs.server)
    outputs.check()
    flags = {"no_rerun": no_rerun, "ros2": ros2}
    again = command_line("run", scenario, set=changes, seed=loaded.run.seed, **flags)
    gl.is_there()
    console = Console(quiet=quiet)
    name = f"{loaded.name}-{loaded.run.seed}"
    try:
        with waiting(console, WAITING):
            episode = Episode(loaded)
    except PartFailed as error:
        raise with_traceback(error, prepare(out, name)) from None
    with episode:
        plain(console, *remarks(episode))
        viewer = outputs.viewer()
        folder = prepare(out, name)
        announce(viewer, console)
        more = outputs.of_run(episode, viewer)
        steps = Columns()
        try:
            output = RunFolder(folder, episode, rerun=not no_rerun, more=more)
            writing = _write(episode, output, console, steps)
        except (PartFailed, Refused, KeyboardInterrupt) as error:
            if not steps:
                discard(folder, outputs.files)
            if isinstance(error, PartFailed):
                raise with_traceback(error, folder) from None
            raise
    job = Job(0, LoadedScenario(loaded), loaded.run.seed, command=again)
    record = record_of(job, loaded, steps)
    _print_record(
        console,
        loaded,
        record,
        features=len(steps.first.scene.features.names),
        all_measures=all_measures,
    )
    doubt = remarks_on_tracker(steps, is_guest=isinstance(loaded.tracker, GuestSettings))
    plain(console, unjudged(loaded, record.success), doubt)
    if all_measures:
        console.print(_stage_line(steps, writing))
    paths = output.finish(RunReport.of(record, loaded, steps.first.scene, doubt))
    plain(console, *_where_and_next(folder, paths, all_measures=all_measures))
    print_missed(Console(stderr=True), record)
    linger(viewer, console)
    if output.refused is not None:
        raise output.refused
    return 1 if record.missed else 0


def _write(episode: Episode, output: RunFolder, console: Console, run: Columns) -> list[float]:
    """Run an episode to its end, and add each step to `run` and to the output; return the time that
    writing each step took [s].
    """
    writing: list[float] = []
    with closing(output.close), progress_bar(console) as progress:
        name = escape(episode.scenario.name)
        task = progress.add_task(name, total=episode.frames, note=COMPILING)
        for step in episode:
            note = f"error {step.servo_error:5.1f} px  {step.estimate.status.name}"
            progress.update(task, advance=1, note=note)
            began = time.perf_counter()
            output.add(step)
            writing.append(time.perf_counter() - began)
            run.add(step)
    return writing


def load(
    name: str, changes: Sequence[str], seed: int | None, server: Server | None = None
) -> Scenario:
    """Read a scenario and check its settings and bounds.

    Args:
        name: A shipped scenario or a TOML file.
        changes: Changes of settings, such as "run.duration=5".
        seed: Seed in place of run.seed; None: the scenario's own.
        server: Connection to a controller in ROS 2, which replaces the scenario's controller;
            changes of run.latency and run.latency_ms are then ignored. None: the scenario's
            controller.

    Raises:
        Mistake: There is no such scenario, or a setting or a bound is wrong.
    """
    if server is None:
        scenario = scenarios.load(name, changes, seed)
    else:
        used = [c for c in changes if c.partition("=")[0].strip() not in server.UNUSED]
        scenario = scenarios.load(name, [*server.SETTINGS, *used], seed, controller=server)
    return scenario


def _outline_line(outline: Array) -> str:
    """Return a sentence about the target's reference rectangle, which was computed from the model:
    its corners are (4, 3) in the target's frame [m].
    """
    sides = Outline(outline)
    x, y = outline.mean(axis=0)[:2]
    return (
        f"The target's reference rectangle, as seen from above: {sides.length:.3f} x "
        f"{sides.width:.3f} m, {sides.height:.3f} m over the table, its centre at x = {x:.3f}, "
        f"y = {y:.3f} m of the target's frame; target.outline sets another one"
    )


def remarks(episode: Episode) -> list[str]:
    """Return remarks for the user about a run that is about to begin, a sentence each: about the
    target, the robot, the start, the tracker, measures without a value, and settings without
    effect.
    """
    first, region, state = episode.shown
    lines = [
        _outline_line(episode.world.outline) if episode.world.outline_found else "",
        *doubts(episode.world.robot),
        *episode.scenario.recording.remarks(episode.world.camera.focal),
        *_start_lines(episode),
        advice(episode.scenario.tracker, first.image, region, state),
        _tilt_line(episode),
        *measures_lines(episode.scenario),
        *idle_settings(episode),
    ]
    return [line for line in lines if line]


def _tilt_line(episode: Episode) -> str:
    """Return a warning if the camera starts with a tilt that the features could servo, but that
    neither the tracker nor the depth picture measures; else an empty text.
    """
    scenario = episode.scenario
    tracker = kind_of(scenario.tracker)
    if traits_of(scenario.tracker) is None or reports_corners(scenario):
        return ""
    if scenario.sight.plane == "picture":
        return ""
    is_tilted = scenario.start.tilt_deg > degrees(START_TURNED)
    if not is_tilted or episode.loop.law.uses_pictures:
        return ""
    if len(episode.loop.features.values(episode.running.goal_sight)) < DOF:
        return ""
    instead = "tracker.corners = true" if tracker == "truth" else "the tracker tag or homography"
    return (
        f"The tracker {tracker} reports no corners, so the tilt of the start is not measured and "
        f"not servoed; {instead} measures it"
    )


def measures_lines(scenario: Setup) -> list[str]:
    """Return warnings about a scenario, a sentence each: measures have no value because the run
    ends before `measure.after`, from which on frames count; or every run keeps, or every run
    misses, a bound.
    """
    lines = list[str]()
    period = 1 / scenario.camera.rate
    last = (scenario.frames - 1) * period
    if last < scenario.measure.after or scenario.run.duration <= scenario.measure.after:
        lines.append(
            f"The last picture is taken at {last:g} s, and measure.after = "
            f"{scenario.measure.after:g} s: measures that count from that time on have no value"
        )
    if scenario.run.frames_late(period) * period >= scenario.run.duration:
        lines.append(
            f"The run ends after {scenario.run.duration:g} s, before its first command acts: no "
            "command moves the camera"
        )
    if isinstance(scenario, Scenario):
        lines += doubts_of(scenario)
    return lines


def _start_lines(episode: Episode) -> list[str]:
    """Return warnings: the robot cannot take the start pose, a joint will reach the end of its
    range, or the target is hidden in the first picture.
    """
    begun = episode.begun
    visible = episode.world.visible()
    lines = list[str]()
    if begun.distance >= START_NEAR or begun.angle >= START_TURNED:
        lines.append(
            "The robot cannot take the start pose: it begins where it sees the target in the same "
            f"direction, {begun.distance:.2f} m and {degrees(begun.angle):.0f} deg from that pose"
        )
    if begun.rollout is not None and begun.rollout.joint:
        lines.append(
            f"With this motion the joint {begun.rollout.joint} reaches the end of its range after "
            f"{begun.rollout.time:.1f} s; no other start posture was found that stays inside the "
            "ranges"
        )
    if visible < HIDDEN:
        lines.append(
            f"The target is hidden in the first picture: {100 * visible:.0f} % of it is visible"
        )
    return lines


def _print_record(
    console: Console, scenario: Scenario, record: Record, *, features: int, all_measures: bool
) -> None:
    """Print how a run with this number of features ended, its measures beside their bounds, and its
    drawn settings.
    """
    outcome = f"{record.outcome}. {Outcome[record.outcome].sentence(record.limits, record.off)}"
    console.print(f"[bold]{escape(scenario.name)}[/], seed {record.seed}: {outcome}")
    if all_measures:
        print_table(console, _table_of(scenario, record))
    else:
        plain(console, _bounds_line(scenario, record, features))
    if scenario.drawn:
        values = ", ".join(f"{key} = {shown(value)}" for key, value in scenario.drawn.items())
        plain(console, f"drawn for seed {scenario.run.seed}: {values}")
    if not scenario.run.repeats:
        plain(console, DOES_NOT_REPEAT)
    changed = scenario.rates_changed.items()
    plain(console, *(f"{key} = {hz:.6g} Hz was used, to fit camera.rate" for key, hz in changed))


def _table_of(scenario: Scenario, record: Record) -> Table:
    """Return the table of all measures of a run, beside their bounds."""
    rows: list[list[str]] = []
    for name, measure in MEASURES.items():
        bound = scenario.expect.get(name, "")
        limit = f"{bound:g}" if isinstance(bound, int | float) else bound
        rows.append([name, shown(record.measures[name]), limit, measure.meaning])
    return Table(("measure", "value", "bound", "meaning"), rows, words=(0, 3))


def _bounds_line(scenario: Scenario, record: Record, features: int) -> str:
    """Return a line with the measures of a run that have a bound, beside it, or with the most
    telling ones if none has; then those of the camera's pose, if this number of features determines
    it.
    """
    bounds = {n: b for n, b in scenario.expect.items() if isinstance(b, int | float)}
    told = [f"{name} {shown(record.measures[name])} (bound {of:g})" for name, of in bounds.items()]
    others = [*(() if bounds else TELLING), *pose_measures(features)]
    told += [f"{name} {shown(record.measures[name])}" for name in others if name not in bounds]
    return "  " + ", ".join(told)


def _where_and_next(folder: Path, paths: Sequence[Path], *, all_measures: bool) -> list[str]:
    """Return a line with the files of a run's folder, those elsewhere, a line each, and a line with
    commands that go on from there.
    """
    names = [path.name for path in paths if path.parent == folder]
    others = [f"  {path}" for path in paths if path.parent != folder]
    where = shlex.quote(str(folder))
    commands = ("view", "report") if RECORDING in names else ("report",)
    following = ", ".join(f"servobench {command} {where}" for command in commands)
    more = "" if all_measures else "; --all prints every measure"
    return [f"  {folder}: {', '.join(names)}", *others, f"  next: {following}{more}"]


def _stage_line(run: Columns, writing: Sequence[float]) -> str:
    """Return a sentence about the median times of the stages of a step, and of writing it [ms]."""
    seconds = timed(run)
    stages = zip(("render", "track", "control", "physics"), np.median(seconds, axis=0), strict=True)
    parts = "  ".join(f"{stage} {1e3 * spent:.2f}" for stage, spent in stages)
    return (
        f"A step took {1e3 * np.median(seconds.sum(axis=1)):.1f} ms: {parts}; "
        f"writing it took {1e3 * median(writing):.1f} ms (medians)"
    )


def print_missed(console: Console, record: Record) -> None:
    """Print a line for each bound that a run missed, and the command that repeats the run; nothing
    if it missed none.
    """
    lines = missed_lines(record.missed, record.measures)
    again = f"  again: {record.command}" * bool(record.missed)
    plain(console, *(f"missed: {line}" for line in lines), again)
