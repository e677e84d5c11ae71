"""The command `servobench film`: run two scenarios and write one film (MP4) of both, beside each
other.
"""

import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from servo.cli.jobs import progress
from servo.cli.main import app
from servo.cli.options import exactly
from servo.cli.outputs import Outputs
from servo.cli.terminal import plain
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.output.film import write_film_of_two
from servo.scenario.load import Scenario, load
from servo.scenario.part_names import changes_of
from servo.study.run_report import RunReport

TWO = 2
"""Number of runs in a film."""


def run(runs: Sequence[str], out: Path, quiet: bool) -> None:
    """Run two scenarios and write one film (MP4) of both, beside each other.

    Args:
        runs: Two runs: for each the folder of a run to repeat, or the arguments of `servobench run`
            as a text.
        out: The film's file.
        quiet: Whether to print nothing but mistakes.

    Raises:
        Mistake: There are not two runs, a run cannot be repeated, the frame rates of the two
            cameras differ, or the film's name does not end in .mp4, exists already or cannot be
            written.
        Refused: The disk is full or fails.
        click.UsageError: A text is not the arguments of `servobench run`.
    """
    if len(runs) != TWO:
        raise Mistake(
            f"film: give two runs, each in quotes if it has several words; {len(runs)} were given"
        )
    Outputs(video=out).check()
    console = Console(quiet=quiet)
    with ExitStack() as stack:
        left, right = (stack.enter_context(Episode(scenario_to_repeat(given))) for given in runs)
        frames = max(left.frames, right.frames)
        with progress(console, out.name, frames) as written:
            write_film_of_two((left, right), (runs[0], runs[1]), out, written)
    plain(console, str(out))


def scenario_to_repeat(given: str) -> Scenario:
    """Return the scenario of a run to repeat: of the run in a folder, or of the arguments of
    `servobench run` in a text.

    Raises:
        Mistake: The folder has no report of a run, a quotation mark in the text is not closed, the
            scenario is wrong, or the run was driven by ROS 2.
        click.UsageError: The text is not the arguments of `servobench run`.
    """
    if given and Path(given).is_dir():
        report = RunReport.read(Path(given) / RunReport.FILE)
        given = report.command.removeprefix("servobench run ")
    try:
        words = shlex.split(given)
    except ValueError as error:
        raise Mistake(f"film: {given}: {error}") from None
    options = app.commands["run"].make_context("run", words).params
    if options["ros2"]:
        raise Mistake("film: a run with --ros2 cannot be repeated: name another run")
    parts = changes_of(options["tracker"], options["controller"])
    changes = [*parts, *options["changes"]]
    drawn = exactly(changes) if options["exact"] else changes
    return load(options["scenario"], drawn, options["seed"])
