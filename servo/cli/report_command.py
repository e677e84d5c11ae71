"""The command `servobench report`: write one page about the results in some folders."""

from collections.abc import Callable, Sequence
from pathlib import Path

from servo.mistake import Mistake, check_suffix, unwritable
from servo.output.steps_table import STREAM, TABLE
from servo.papers.claims import PapersReport
from servo.report import (
    bench_section,
    benchmark_section,
    papers_section,
    run_section,
    study_section,
)
from servo.report.page import Section, render
from servo.study.run_report import RunReport
from servo.study.store import StudyFile
from tracking.files import atomic

PAGE = "report.html"
PAGES = (".html", ".htm")


def _study(folder: Path) -> Section:
    study = StudyFile.read(folder / StudyFile.FILE)
    if study.holds == "bench":
        return bench_section.section(folder, study)
    if study.holds == "benchmark":
        return benchmark_section.section(folder, study)
    if study.holds == "papers":
        return papers_section.section(folder)
    return study_section.section(folder)


KINDS: tuple[tuple[tuple[str, ...], Callable[[Path], Section]], ...] = (
    ((StudyFile.FILE,), _study),
    ((PapersReport.FILE,), papers_section.section),
    ((TABLE, STREAM), run_section.section),
)
"""Files by which a kind of folder is recognised, and the function that makes its section."""


def write(folders: Sequence[Path], out: Path | None) -> Path:
    """Write the page; its path.

    Raises:
        Mistake: A folder is missing, unknown or damaged, or the page cannot be written.
        Refused: The disk is full.
    """
    text = render([_section(folder) for folder in folders])
    path = out or folders[0] / PAGE
    _check_out(path)
    try:
        return atomic.write(path.parent, path.name, text)
    except OSError as error:
        raise unwritable(path, error, "this page") from None


def _check_out(path: Path) -> None:
    """Refuse a path at which the page must not be written."""
    if not path.parent.is_dir():
        raise Mistake(f"{path}: cannot write this page: there is no such folder")
    if path.is_dir():
        raise Mistake(f"{path}: this is a folder; --out takes the file to write, such as page.html")
    check_suffix(path, *PAGES)


def _section(folder: Path) -> Section:
    if not folder.is_dir():
        raise Mistake(f"{folder}: there is no such folder")
    for names, section in KINDS:
        if any((folder / name).exists() for name in names):
            return section(folder)
    if (folder / RunReport.FILE).exists():
        raise Mistake(
            f"{folder / RunReport.FILE}: there is no {TABLE} beside it; is this a run's folder?"
        )
    raise Mistake(
        f"{folder}: nothing in this folder is of `servobench run`, `bench`, `papers` or `sweep`"
    )
