"""The command `servobench film`: run two scenarios and write one film (MP4) of both, beside each
other.
"""

import shlex
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from servo.cli.jobs import progress
from servo.cli.outputs import Outputs
from servo.cli.terminal import plain
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.output.film import write_film_of_two
from servo.scenario.load import Scenario
from servo.study.run_report import RunReport


def write(
    runs: tuple[str, str], asked: Callable[[list[str]], Scenario], out: Path, *, quiet: bool
) -> None:
    """Run two scenarios and write one film (MP4) of both, beside each other.

    Args:
        runs: Each the folder of a run to repeat, or the arguments of `servobench run` as a text.
        asked: Function that returns the scenario that a list of arguments of `servobench run`
            names.
        out: The film's file.
        quiet: Whether to print nothing but mistakes.

    Raises:
        Mistake: A run cannot be repeated, or the file cannot be written.
    """
    Outputs(video=out).check()
    console = Console(quiet=quiet)
    with ExitStack() as stack:
        left, right = (stack.enter_context(Episode(asked(_words(run)))) for run in runs)
        frames = max(left.frames, right.frames)
        with progress(console, out.name, frames) as written:
            write_film_of_two((left, right), runs, out, written)
    plain(console, str(out))


def _words(run: str) -> list[str]:
    """Return the arguments of `servobench run` as a list: those of the given text, or those in the
    report of the run whose folder is given.
    """
    if run and Path(run).is_dir():
        run = RunReport.read(Path(run) / RunReport.FILE).command.removeprefix("servobench run ")
    try:
        return shlex.split(run)
    except ValueError as error:
        raise Mistake(f"film: {run}: {error}") from None
