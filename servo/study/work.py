"""The missing runs of a study, done on a cluster and kept in its folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from servo.batch.cluster import Cluster, carry_out
from servo.study.perform import perform
from servo.study.plan import Study
from servo.study.store import Store


@dataclass(frozen=True, slots=True)
class FailedRun:
    """Why a run failed."""

    reason: str
    """The last line of its error."""
    command: str
    """Repeats the run."""
    path: Path
    """The file that keeps both, and the traceback."""


def work(study: Study, store: Store, cluster: Cluster) -> Iterator[FailedRun | None]:
    """Do each run that is not finished, and keep it; as each ends, why it failed, or None.

    Raises:
        Lost: The workers are gone.
    """
    done = store.done()
    missing = (run for run in study.runs() if run.number not in done)
    for run, ended in carry_out(cluster, missing, perform):
        if ended.error:
            command = run.command(study.changes)
            yield FailedRun(ended.reason, command, store.fail(run, ended.error, command))
        else:
            store.add(ended.value)
            yield None
