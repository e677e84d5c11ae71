"""Worker processes for the jobs of the papers' claims."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from servo.batch.jobs import Done, Job, attempt
from servo.mistake import Refused
from servo.study import execute
from servo.study.failure import ClusterLost, Failure


class Workers(execute.Workers):
    """Processes that do jobs, started with the first task; used in a `with`."""

    def results(self, jobs: Sequence[Job], folder: Path) -> Iterator[Done]:
        """Do jobs and store their results in a folder; yields each as it ends."""
        try:
            for job, ended in self.do(jobs, partial(attempt, folder=folder)):
                yield Done(job, None, ended.error) if isinstance(ended, Failure) else ended
        except ClusterLost as error:
            raise Refused(f"{error}; what was written is complete up to here") from None
