"""A job: one repeatable run of a subject, which is a scenario or a sequence with a tracker."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from servo.scenario.draws import Value
from servo.study.record import Record


class Subject(Protocol):
    """What a job runs."""

    @property
    def name(self) -> str:
        """Its name in tables."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return what decides the numbers, in the types of JSON."""
        ...

    def perform(self, job: Job, folder: Path) -> Record:
        """Run a job of this subject; it may write files of its own into the study's folder."""
        ...


@dataclass(frozen=True, slots=True)
class Job:
    """One run, with all that a worker needs; it is sent between processes."""

    number: int
    """Place in its study, from 0."""
    subject: Subject
    seed: int
    settings: dict[str, Value] = field(default_factory=dict[str, Value])
    """What distinguishes it from the others: values of axes and draws, by key."""
    command: str = ""
    """Repeats this run alone."""
    pictured: bool = False
    """Whether its contact sheet is kept."""

    @property
    def key(self) -> str:
        """Name of its file."""
        return f"{self.number:06}"

    def describe(self) -> dict[str, Any]:
        """Return what decides its record, versions apart, in the types of JSON."""
        return {"subject": self.subject.describe(), "seed": self.seed, "settings": self.settings}

    def run(self, folder: Path) -> Record:
        """Run it; `folder` is that of its study.

        Raises:
            Mistake: A setting is not valid.
        """
        return self.subject.perform(self, folder)
