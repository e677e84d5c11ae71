"""What `servobench check` writes for other programs: JUnit's XML and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

from servo.loop.run_measures import MEANINGS
from servo.mistake import Mistake, check_suffix, unwritable
from servo.output.formats import Made, Number
from servo.study.bounds import MissedBound
from servo.study.failure import Failure
from servo.study.job import Job
from servo.study.record import Record
from tracking.files import atomic
from tracking.files.json_text import number


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRun:
    """One run of a check."""

    scenario: str
    seed: int
    command: str
    """The command that repeats it."""
    seconds: float = 0.0
    """Wall-clock time."""
    outcome: str = ""
    measures: dict[str, Number | None]
    missed: list[MissedBound]
    """The bounds that were not kept."""
    failed: str = ""
    """Why there is no outcome, in a sentence."""

    @staticmethod
    def of(job: Job, end: Record | Failure) -> CheckedRun:
        """How a job ended."""
        if isinstance(end, Failure):
            return CheckedRun(
                scenario=job.subject.name,
                seed=job.seed,
                command=job.command,
                measures={},
                missed=[],
                failed=end.reason,
            )
        return CheckedRun(
            scenario=end.subject,
            seed=end.seed,
            command=end.command,
            seconds=end.seconds,
            outcome=end.outcome,
            measures={name: number(end.measures[name]) for name in MEANINGS},
            missed=list(end.missed),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckFile(Made):
    """The file of --json."""

    FILE: ClassVar[str] = "check.json"
    KIND: ClassVar[str] = "check"

    runs: list[CheckedRun]


def check_place(path: Path | None, suffix: str) -> None:
    """Refuse a file that cannot be written, or that may be the user's own, before the runs.

    Raises:
        Mistake: Its folder is missing, it is a folder, a device or a link, or has another suffix.
    """
    if path is None:
        return
    check_suffix(path, suffix)
    other = path.is_symlink() or (path.exists() and not path.is_file())
    if other or not path.absolute().parent.is_dir():
        raise Mistake(f"{path}: this should be a file to write, in a folder that is there")


def write(path: Path, content: str) -> None:
    """Write a file.

    Raises:
        Mistake: It cannot be there.
        Refused: The disk refuses.
    """
    try:
        atomic.write(path.absolute().parent, path.name, content)
    except OSError as error:
        raise unwritable(path, error, "this file") from None


def junit(runs: list[CheckedRun]) -> str:
    """A test case for each run: what was missed, with the command that repeats it."""
    suite = ElementTree.Element("testsuite", name="servobench check", tests=str(len(runs)))
    for run in runs:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            classname=f"servobench.{run.scenario}",
            name=f"{run.scenario}, seed {run.seed}",
            time=f"{run.seconds:.3f}",
        )
        message = run.failed or "; ".join(map(str, run.missed))
        if message:
            tag = "error" if run.failed else "failure"
            ElementTree.SubElement(case, tag, message=message).text = f"again: {run.command}"
    for plural, tag in (("failures", "failure"), ("errors", "error")):
        suite.set(plural, str(len(suite.findall(f"testcase/{tag}"))))
    suite.set("time", f"{sum(run.seconds for run in runs):.3f}")
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
