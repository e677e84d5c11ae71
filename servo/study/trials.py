"""Trials: runs of a scenario with settings that a command, such as a tuner, chooses while it works.
Their records are kept in the command's folder.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from servo.mistake import Mistake
from servo.scenario.named_files import digests, named_in
from servo.scenario.toml import Table
from servo.study.execute import Workers, complete
from servo.study.parse import parsed
from servo.study.run import Failure, Job, Record
from servo.study.scenario_run import StudiedScenario
from servo.study.store import Store, StudyFile

KEY = 24
"""Length of the name of a run [characters]: the beginning of the digest of its job."""
Trial = tuple[Table, int]
"""Settings of a run by dotted key, and its seed."""


class Trials:
    """Callable object that runs a scenario in worker processes, with given settings and seeds, and
    returns the records (the results). It calls `ended` with a note after each run.

    The folder (`store`) keeps the record of each run by its settings and seed, so that a command
    that is given again repeats no run.
    """

    def __init__(
        self,
        base: StudiedScenario,
        store: Store,
        workers: Workers,
        ended: Callable[[str], None],
    ) -> None:
        """Keep what runs need.

        Args:
            base: The scenario.
            store: The folder of the command, after `Store.find`.
            workers: The processes that do the runs.
            ended: Is called after each run, with a note.
        """
        self._base = base
        self._store = store
        self._workers = workers
        self._ended = ended

    def __call__(self, asked: Sequence[Trial]) -> list[Record | None]:
        """Do the runs that have no record yet, and return the records of all, with their values
        over time, in the same order; None for a run that failed.

        Args:
            asked: Settings and seed of each run.

        Raises:
            ClusterLost: The workers have stopped, or one has several threads.
            Mistake: A run failed while no run had a record yet, a worker has other versions of
                packages or other source code, or the database is damaged.
            Refused: The disk is full, the machine had no room left in a run, or the processes
                cannot be started.
        """
        jobs = [self._job(settings, seed) for settings, seed in asked]
        once = {job.key: job for job in jobs}.values()
        for job, end in complete(once, self._store, self._workers):
            if isinstance(end, Failure) and not self._store.done:
                raise Mistake(f"the first run fails: {end.reason} (again: {job.command})")
            self._ended(f"seed {job.seed}")
        done = iter(self._store.records(jobs))
        return [next(done) if job.key in self._store.done else None for job in jobs]

    def _job(self, settings: Table, seed: int) -> Job:
        named = digests(named_in({"set": settings}, self._base.table))
        base = replace(self._base, files=self._base.files | named)
        job = Job(0, base, seed, settings, base.command(seed, settings))
        return replace(job, name=job.digest[:KEY])


def trial_study(
    holds: str, scenario: str, changes: Sequence[str], command: str
) -> tuple[StudiedScenario, StudyFile]:
    """Return a scenario with changes, for use by `Trials`, and the contents of study.json for the
    folder of the trials.

    Args:
        holds: Name of the command, such as "tune".
        scenario: Name of a shipped scenario, or path of a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        command: The command line that repeats the command.

    Raises:
        Mistake: The scenario or a change is wrong.
    """
    table: Table = {"scenario": scenario, "seeds": 1}
    study = parsed(table, changes, Path(f"{holds}.toml"), holds, f"{holds} {scenario}")
    return study.bases[0], replace(StudyFile.of(study, command), holds=holds)
