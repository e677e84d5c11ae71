"""What `servobench report` does: see what each folder is, and write one page about them all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from servo.mistake import Mistake
from servo.papers.command import SUMMARY
from servo.report import bench, papers, run, study
from servo.report.page import Section, render
from servo.report.study_data import MANIFEST
from servo.run_folder import REPORT
from servo.steps_table import STREAM, TABLE

PAGE = "report.html"
KINDS: tuple[tuple[tuple[str, ...], Callable[[Path], Section]], ...] = (
    ((MANIFEST,), study.section),
    ((SUMMARY,), papers.section),
    ((bench.BENCH,), bench.section),
    ((TABLE, STREAM), run.section),
)
"""Files that tell what a folder is, and who reads it."""


def write(folders: Sequence[Path], out: Path | None) -> Path:
    """Write the page; its path.

    Raises:
        Mistake: A folder is missing, unknown or broken, or the page cannot be written.
    """
    text = render([_section(folder) for folder in folders])
    path = out or folders[0] / PAGE
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Mistake(f"{path}: cannot write this page: {error.strerror}") from None
    return path


def _section(folder: Path) -> Section:
    if not folder.is_dir():
        raise Mistake(f"{folder}: there is no such folder")
    for names, section in KINDS:
        if any((folder / name).exists() for name in names):
            return section(folder)
    if (folder / REPORT).exists():
        raise Mistake(f"{folder / REPORT}: there is no {TABLE} beside it; is this a run's folder?")
    raise Mistake(
        f"{folder}: nothing in this folder is of `servobench run`, `bench`, `papers` or `sweep`"
    )
