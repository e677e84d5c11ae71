"""The tables of a page as LaTeX, and its figures as files to print."""

import re
from collections.abc import Iterator, Sequence

from jinja2 import Environment, StrictUndefined

from servo.report.charts import saved
from servo.report.page import Figure, PageImage, Section, template

KINDS = ("pdf", "svg", "pgf")
"""Formats of figures."""
MOST_ROWS = 60
"""Longer tables do not fit a page, and are left out."""
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
    """Return the tables of a page as LaTeX, each in an environment `table`."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["tex"] = _escaped
    text = template("tables.tex.jinja")
    return environment.from_string(text).render(sections=sections, most=MOST_ROWS)


def _escaped(text: str) -> str:
    return text.translate(TEX)


def figures(sections: Sequence[Section], kind: str) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of a file for each figure that is drawn from values.

    Args:
        sections: Those of the page.
        kind: pdf, svg or pgf.

    Raises:
        Mistake: TeX, which a PGF needs, is not there.
    """
    blocks = [block for section in sections for block in section.blocks]
    every: list[Figure | PageImage] = [f for b in blocks for f in (*b.figures, *b.pictures)]
    drawn = [figure for figure in every if figure.drawing is not None]
    for number, figure in enumerate(drawn, 1):
        words = re.sub(r"[^a-z0-9]+", "-", figure.title.lower()).strip("-")
        yield f"{number:02}-{words[:40]}.{kind}", saved(figure, kind)
