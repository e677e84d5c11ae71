"""Many jobs under one progress bar; what was finished is kept, failures are told at the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.markup import escape

from servo.ended import Ended, Lost, one_by_one
from servo.mistake import FULL, Mistake, Refused
from servo.result_folder import GOES_ON
from servo.terminal import COMPILING, plain, progress_bar, stop
from tracking.evaluation.jobs import Done, Job, attempt, damaged, known

Task = TypeVar("Task")
MOST_RUNS = 100_000
"""Runs of one command: more would fill memory before the first of them ends."""


def check_number(runs: int) -> None:
    """Refuse more runs than any machine ends.

    Raises:
        Mistake: There are too many.
    """
    if runs > MOST_RUNS:
        raise Mistake(f"these are {runs:,} runs; the limit is {MOST_RUNS:,}")


class Team:
    """Processes that do jobs, started when there is something to do; use it in a `with`."""

    def __init__(self, workers: int) -> None:
        """Engage a team.

        Args:
            workers: Number of processes; 1: this one.

        Raises:
            Mistake: The machine cannot hold so many.
        """
        self._workers = workers
        self._open = ExitStack()
        if workers > 1:
            from servo.farm.local import check_workers  # Dask takes a second to import

            check_workers(workers)

    def __enter__(self) -> Team:
        return self

    def __exit__(self, *told: Any) -> None:
        self._open.__exit__(*told)

    def results(self, jobs: Sequence[Job], folder: Path) -> Iterator[Done]:
        """Do what has no result yet; the others give what they have. The order is that of ends."""
        kept = {job.key: known(job, folder) for job in jobs}
        yield from (done for done in kept.values() if done is not None)
        todo = [job for job in jobs if kept[job.key] is None]
        for job, ended in self.ends(todo, partial(attempt, folder=folder)):
            yield Done(job, None, ended.error) if ended.error else ended.value

    def ends(
        self, tasks: Sequence[Task], work: Callable[[Task], Any]
    ) -> Iterator[tuple[Task, Ended]]:
        """Do tasks; the order is that of their ends.

        Raises:
            Refused: The machine lets no process work.
        """
        if self._workers == 1 or not tasks:
            yield from one_by_one(tasks, work)
            return
        from servo.farm.tasks import carry_out

        try:
            yield from carry_out(self._crew, tasks, work)
        except Lost as error:
            raise Refused(f"{error}; what was written is complete up to here") from None

    @cached_property
    def _crew(self):
        from servo.farm.local import local

        return self._open.enter_context(local(self._workers))


def work(
    jobs: Sequence[Job], folder: Path, team: Team, console: Console, title: str
) -> tuple[list[Done], int]:
    """Run jobs under a progress bar, in the order asked for; the exit code: 1 for failures.

    Raises:
        Mistake: Two jobs have the same name.
        OSError: The disk is full.
    """
    keys = [job.key for job in jobs]
    double = next((key for key, count in Counter(keys).items() if count > 1), None)
    if double is not None:
        raise Mistake(f"two runs are called '{double}'; give the trackers different labels")
    _print_damaged(damaged(jobs, folder))
    done: dict[str, Done] = {}
    try:
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=len(jobs), note=COMPILING)
            for one in team.results(jobs, folder):
                done[one.job.key] = one
                if one.refused is not None and one.refused.errno in FULL:
                    raise one.refused
                bar.update(task, advance=1, note=escape(one.job.key))
    except KeyboardInterrupt as cause:
        stop(cause, f"{GOES_ON.capitalize()}.")
    failed = [d for d in done.values() if d.result is None]
    for d in failed:
        plain(Console(stderr=True), f"servobench: {d.job.key} failed:\n{d.error}")
    return [done[key] for key in keys if key in done], 1 if failed else 0


def _print_damaged(paths: Sequence[Path]) -> None:
    for path in paths:
        plain(
            Console(stderr=True),
            f"servobench: {path}: this result is damaged, and is computed again",
        )
