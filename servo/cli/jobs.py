"""Runs that a command does as jobs: the estimate of their time, the display of their progress, and
the sentence that says how to continue them.
"""

import os
import shlex
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from servo.cli.guard import stop
from servo.cli.terminal import COMPILING, complain, escape, moves, plain, progress_bar
from servo.mistake import Mistake, Refused
from servo.study.execute import Workers, complete, tried
from servo.study.run import ClusterLost, Failure, Job
from servo.study.store import RUNS, Store

FIRST = 1.0
EVERY = 30.0
"""Times until the first line of progress, and between two, where there is no terminal [s]."""
MINUTE = 60
HOUR = 3600


@contextmanager
def progress(
    console: Console, title: str, total: int, done: int = 0
) -> Generator[Callable[[str], None]]:
    """Context manager that shows progress within its block: a bar on a terminal, else a line on
    stderr after 1 s and then every 30 s, each when a piece of work ends.

    Args:
        console: The output of the command; a quiet console shows no progress.
        title: Name of the work.
        total: Number of pieces of work.
        done: Number of pieces that are done already.

    Yields:
        A function to call after each piece of work, with a note to show.
    """
    if moves(console):
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=total, completed=done, note=COMPILING)
            yield lambda note: bar.update(task, advance=1, note=escape(note))
        return
    errors = Console(stderr=True, quiet=console.quiet)
    began = time.monotonic()
    due = began + FIRST
    count = 0

    def ended(note: str) -> None:
        nonlocal count, due
        count += 1
        now = time.monotonic()
        if now >= due and done + count < total:
            due = now + EVERY
            left = (now - began) / count * (total - done - count)
            plain(errors, f"{title}: {done + count:,} of {total:,}, {note}, {duration(left)} left")

    yield ended


def duration(seconds: float) -> str:
    """Return a time [s] as a text: in whole seconds below 2 min, but at least "1 s"; in whole
    minutes below 2 h ("12 min"); else in hours with one decimal ("2.5 h").
    """
    if seconds < 2 * MINUTE:
        return f"{max(1, seconds):.0f} s"
    return f"{seconds / MINUTE:.0f} min" if seconds < 2 * HOUR else f"{seconds / HOUR:.1f} h"


def print_estimate(
    jobs: Sequence[Job], workers: int | None, console: Console, store: Store | None = None
) -> int:
    """Do up to five of the missing runs without keeping their results, until one fails; print how
    many runs there are, how long the missing ones will take, and on stderr why a run failed.

    Args:
        jobs: All jobs, one for each run.
        workers: Number of processes that will do the jobs; None: those of a cluster, whose number
            is not known.
        console: The output of the command.
        store: The folder in which some of the jobs may have a record; None: no run is finished.

    Returns:
        The exit code: 1 if a run that was tried fails, else 0.

    Raises:
        Mistake: The database in the folder is damaged.
        Refused: The database cannot be read.
    """
    if store is not None:
        store.find(jobs)
    missing = [job for job in jobs if store is None or job.key not in store.done]
    plain(console, f"{len(jobs):,} runs, {len(jobs) - len(missing):,} of them finished")
    if not missing:
        return 0
    spent, failed = tried(missing)
    at_once = 1 if workers is None else min(workers, os.cpu_count() or 1, len(missing))
    whole = duration(spent * len(missing) / at_once)
    shared = f"{at_once} at once" if workers else "in all, to be divided by the cluster's workers"
    plain(console, f"a run takes {spent:.1f} s here, {len(missing):,} runs about {whole}, {shared}")
    again = [f" (again: {job.command})" if job.command else "" for job, _ in failed]
    complain(*(f"{fail.reason}{more}" for (_, fail), more in zip(failed, again, strict=True)))
    return 1 if failed else 0


def go_on(command: str, out: Path | None) -> str:
    """Return the sentence that says how to continue a stopped command.

    Args:
        command: The command line.
        out: The folder given with --out, which is added to the command; None: nothing is added.
    """
    return f"go on with: {command}" + (f" --out {shlex.quote(str(out))}" if out else "")


def complete_jobs(
    jobs: Sequence[Job],
    store: Store,
    workers: Workers,
    console: Console,
    title: str,
    again: str,
) -> int:
    """Do the jobs that have no record in a store, show progress, and print on stderr why jobs
    failed, and whether stored records are damaged.

    Args:
        jobs: All jobs of the study.
        store: The study's folder, after `Store.find` of these jobs.
        workers: The processes that do the jobs.
        console: The output of the command.
        title: The text beside the progress.
        again: A sentence that says how to continue, printed if the command is stopped or the
            workers are lost.

    Returns:
        The number of jobs that failed.

    Raises:
        Mistake: The user's cluster does not answer or has stopped, a worker has other versions of
            packages, or the database of the study is damaged.
        Refused: The disk or the memory is full, or the workers of this machine do not start or
            have stopped.
        SystemExit: Ctrl-C or another signal stopped the command.
    """
    if store.damaged:
        complain(
            f"{store.folder / RUNS}: damaged records, or records of other runs: "
            f"{len(store.damaged)}, the first that of run {store.damaged[0]}; these runs are done "
            "again"
        )
    plain(console, f"{title}: {len(jobs):,} runs, {len(store.done):,} of them finished")
    failed = 0
    alike: dict[str, list[Path]] = {}
    began = time.monotonic()
    try:
        with progress(console, title, len(jobs), len(store.done)) as ended:
            for count, (job, end) in enumerate(complete(jobs, store, workers), 1):
                if isinstance(end, Failure):
                    failed += 1
                    alike.setdefault(end.reason, []).append(store.failure_path(job))
                rate = MINUTE * count / (time.monotonic() - began)
                ended(f"{rate:.1f} a minute, {failed} failed")
    except KeyboardInterrupt as cause:
        store.find(jobs)  # the signal may have come just after a run was stored
        stop(cause, f"{len(store.done)} of {len(jobs)} runs are finished; {again}")
    except ClusterLost as lost:
        sentence = f"{lost}; only {len(store.done)} of {len(jobs)} runs are finished; {again}"
        raise (Refused if workers.scheduler is None else Mistake)(sentence) from None
    for reason, paths in alike.items():
        more = f" (the first of {len(paths)} such runs)" if len(paths) > 1 else ""
        kept = next(filter(Path.exists, paths), paths[0].parent)
        complain(f"{kept}: {reason}{more}")
    finished = [store.failure_path(job) for job in jobs if job.key in store.done]
    if errors := [path for path in finished if path.exists()]:
        complain(
            f"{errors[0].parent}: {len(errors)} of the runs failed first and finished when tried "
            "again: a component in them does not give the same result each time"
        )
    return failed
