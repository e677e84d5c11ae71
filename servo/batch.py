"""Many jobs under one progress bar; what was finished is kept, failures are told at the end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from servo.mistake import Mistake
from servo.terminal import COMPILING, STOPPED, plain, progress_bar
from tracking.evaluation.jobs import Done, Job, run_all

MOST_RUNS = 100_000
"""Runs of one command: more would fill memory before the first of them ends."""


def check_number(runs: int) -> None:
    """Refuse more runs than any machine ends.

    Raises:
        Mistake: There are too many.
    """
    if runs > MOST_RUNS:
        raise Mistake(f"these are {runs:,} runs; the limit is {MOST_RUNS:,}")


def work(
    jobs: Sequence[Job], folder: Path, workers: int, console: Console, title: str
) -> tuple[list[Done], int]:
    """Run jobs under a progress bar, in the order asked for; the exit code: 1 for failures.

    Raises:
        Mistake: The folder cannot be written, or two jobs have the same name.
    """
    keys = [job.key for job in jobs]
    double = next((key for key in keys if keys.count(key) > 1), None)
    if double is not None:
        raise Mistake(f"two runs are called '{double}'; give the trackers different labels")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Mistake(f"{folder}: cannot write to this folder: {error.strerror}") from None
    done: dict[str, Done] = {}
    code = 0
    try:
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=len(jobs), note=COMPILING)
            for one in run_all(jobs, folder, workers):
                done[one.job.key] = one
                bar.update(task, advance=1, note=escape(one.job.key))
    except KeyboardInterrupt:
        plain(Console(stderr=True), f"{STOPPED} The same command goes on from there.")
        code = 130
    failed = [d for d in done.values() if d.result is None]
    for d in failed:
        plain(Console(stderr=True), f"servobench: {d.job.key} failed:\n{d.error}")
    return [done[key] for key in keys if key in done], code or (1 if failed else 0)
