"""Do jobs with a progress bar; results stay on the disk, failures are printed at the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from servo.batch.jobs import Done, Job, damaged
from servo.batch.workers import Workers
from servo.cli.terminal import COMPILING, complain, progress_bar, stop
from servo.mistake import FULL, Mistake
from servo.output.result_folder import GOES_ON
from tracking.files import atomic

FAILURES = "failures"


def work(
    jobs: Sequence[Job], folder: Path, pool: Workers, console: Console, title: str
) -> tuple[list[dict[str, Any]], int]:
    """Do jobs with a progress bar; the results in order, and the exit code: 1 for failures.

    Raises:
        Mistake: Two jobs have the same name.
        OSError: The disk is full.
    """
    keys = [job.key for job in jobs]
    double = next((key for key, count in Counter(keys).items() if count > 1), None)
    if double is not None:
        raise Mistake(f"two runs are called '{double}'; give the trackers different labels")
    for reason in damaged(jobs, folder):
        complain(f"{reason}; it is computed again")
    done: dict[str, Done] = {}
    try:
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=len(jobs), note=COMPILING)
            for one in pool.results(jobs, folder):
                done[one.job.key] = one
                if one.refused is not None and one.refused.errno in FULL:
                    raise one.refused
                bar.update(task, advance=1, note=escape(one.job.key))
    except KeyboardInterrupt as cause:
        stop(cause, f"{GOES_ON.capitalize()}.")
    failed = [d for d in done.values() if d.result is None]
    for d in failed:
        reason = d.error.strip().splitlines()[-1]
        path = atomic.write(folder, f"{FAILURES}/{d.job.key}.txt", d.error)
        complain(f"{d.job.key} failed: {reason}; see {path}")
    results = [done[key].result for key in keys if key in done]
    return [r for r in results if r is not None], 1 if failed else 0
