"""The command `servobench report`: write one page about the results in some folders, and its tables
and figures as files.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click

from servo.bench.names import NAMES
from servo.cli.outputs import check_place
from servo.cli.sweep_command import measures_of
from servo.mistake import Mistake, writing
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
from servo.report.printed import figures, latex
from servo.study.store import StudyFile
from tracking.files import atomic

FIGURES = "figures"
"""Folder of the figures, beside the page."""
PAGES = ("tune", "budget")
"""Commands that write their page themselves."""
ONLY_STUDIES = "--measures is only for folders of sweep and compare: leave out --measures"


@dataclass(frozen=True, slots=True)
class Printed:
    """Options of `servobench report` about files to write beside the page: its tables as LaTeX, and
    its figures; by default none are written.
    """

    latex: Path | None = None
    """File for the tables as LaTeX."""
    figures: str | None = None
    """Format of the figures: pdf, svg or pgf."""
    measures: str | None = None
    """Columns of the tables of studies, with commas."""
    figure_width: float | None = None
    """Width of the figures [inch]; by default that of the page."""


def run(folders: Sequence[Path], out: Path | None, **options: Any) -> None:
    """Write the page about the results in some folders, and print the paths of all files.

    Args:
        folders: The folders, or names of public benchmarks for their published results.
        out: The page's file; None: report.html in the first folder, or NAME.html for the name of a
            benchmark.
        **options: Tables and figures to write too: the fields of `Printed`, by name.

    Raises:
        Mistake: A folder is missing, unknown or damaged, an option is wrong or does not fit the
            folders, or a file cannot be written.
        Refused: The disk is full.
    """
    for path in write(folders, out, Printed(**options)):
        click.echo(path)


def write(folders: Sequence[Path], out: Path | None, printed: Printed | None = None) -> list[Path]:
    """Write the page about the results in some folders, and the files beside it.

    Args:
        folders: The folders, or names of public benchmarks for their published results.
        out: The page's file; None: report.html in the first folder, or NAME.html for the name of a
            benchmark.
        printed: Tables and figures to write beside the page; None: none.

    Returns:
        The paths of the page, and of the LaTeX file and the folder of figures if they were written.

    Raises:
        Mistake: A folder is missing, unknown or damaged, an option in `printed` is wrong or does
            not fit the folders, or a file cannot be written.
        Refused: The disk is full.
    """
    printed = printed or Printed()
    if printed.figure_width is not None and printed.figures is None:
        raise Mistake(
            "--figure-width has no effect without --figures: add --figures pdf, svg or pgf"
        )
    measures = None if printed.measures is None else measures_of(printed.measures)
    of_first = folders[0] / "report.html" if folders[0].is_dir() else Path(f"{folders[0]}.html")
    path = out or of_first
    check_place(path, ".html", ".htm")
    check_place(printed.latex, ".tex")
    sections = [section_of(folder, measures) for folder in folders]
    files: dict[Path, str | bytes] = {path: render(sections)}
    if printed.latex is not None:
        files[printed.latex] = latex(sections)
    paths = list(files)
    if printed.figures is not None:
        named = list(figures(sections, printed.figures, printed.figure_width))
        if named:
            paths.append(path.parent / FIGURES)
        files |= {path.parent / FIGURES / name: content for name, content in named}
    for place, content in files.items():
        with writing(place, "this page"):
            atomic.write(place.parent, place.name, content)
    return paths


def section_of(folder: Path, measures: Sequence[str] | None = None) -> Section:
    """Return the section of an HTML page about the results in a folder.

    Args:
        folder: The folder, or the name of a public benchmark for its published results.
        measures: Columns of the tables of a study (the result of `sweep` or `compare`); None: a
            few.

    Raises:
        Mistake: The folder is missing, has no results or is damaged, or has results of `tune` or
            `budget`, which write their pages themselves; the benchmark has no published results; or
            `measures` are given for results that are not of a study.
    """
    if not folder.is_dir():
        if str(folder) in NAMES and measures is None:
            return benchmark_section.published_section(str(folder))
        raise Mistake(
            f"{folder}: there is no such folder: name one, or {' or '.join(NAMES)} without "
            "--measures"
        )
    study = None
    if (folder / StudyFile.FILE).exists():
        study = StudyFile.read(folder / StudyFile.FILE)
    if measures is not None and (study is None or study.holds != "sweep"):
        raise Mistake(f"{folder}: {ONLY_STUDIES}")
    if study is not None:
        of_studies = {
            "evaluate": partial(bench_section.section, study=study),
            "benchmark": partial(benchmark_section.section, study=study),
            "papers": papers_section.section,
        }
        if study.holds in PAGES:
            raise Mistake(f"{folder}: this folder has its page already: open report.html")
        of_sweep = partial(study_section.section, measures=measures)
        return of_studies.get(study.holds, of_sweep)(folder)
    if (folder / PapersReport.FILE).exists():
        return papers_section.section(folder)
    if (folder / TABLE).exists() or (folder / STREAM).exists():
        return run_section.section(folder)
    raise Mistake(
        f"{folder}: this folder has no results of `servobench run`, `evaluate`, `benchmark`, "
        "`papers`, `sweep` or `compare`: name a folder that one of them wrote"
    )
