"""The tables of a report as LaTeX, and its figures as PDF, SVG or PGF files."""

import re
from collections.abc import Iterator, Sequence

from servo.report.charts import saved
from servo.report.page import Section, template

KINDS = ("pdf", "svg", "pgf")
"""Formats of figures."""
MOST_ROWS = 60
MOST_COLUMNS = 16
"""Most rows and columns of a table; larger ones do not fit a page, and are left out."""
TEX = str.maketrans(
    {c: f"\\{c}" for c in "{}$&#%_"}
    | {
        "\\": r"\textbackslash{}",
        "^": r"\textasciicircum{}",
        "~": r"\textasciitilde{}",
        "\N{EN DASH}": "--",
        "\N{LESS-THAN OR EQUAL TO}": r"$\leq$",
    }
)
"""Characters that LaTeX acts upon or lacks, and how they are written."""


def latex(sections: Sequence[Section]) -> str:
    """Return the tables of all sections of a report as LaTeX, each in an environment `table`, to be
    included by a document that loads booktabs. Tables of more than 60 rows or 16 columns are left
    out.
    """
    tables = template("tables.tex.jinja", tex=_escaped, label=_label)
    return tables.render(sections=sections, rows=MOST_ROWS, columns=MOST_COLUMNS)


def _escaped(text: str) -> str:
    return text.translate(TEX)


def _label(title: str) -> str:
    """Return a title in lower case with hyphens, as a part of a label or a file's name."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:40]


def figures(
    sections: Sequence[Section], kind: str, width: float | None = None
) -> Iterator[tuple[str, bytes]]:
    """Yield (file name, content) for each figure of the sections that has a drawing, such as
    "01-success.pdf".

    Args:
        sections: Sections of an HTML report.
        kind: pdf, svg or pgf.
        width: Width of each figure [inch]; None: that on the page.

    Raises:
        Mistake: A PGF needs TeX, which is not installed.
    """
    blocks = [block for section in sections for block in section.blocks]
    drawn = [figure for block in blocks for figure in block.figures if figure.drawing is not None]
    for number, figure in enumerate(drawn, 1):
        yield f"{number:02}-{_label(figure.title)}.{kind}", saved(figure, kind, width)
