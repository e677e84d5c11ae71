"""Figures as SVG with a transparent background and the colours of the page.

Matplotlib draws with placeholder colours. In the SVG they become `currentColor` and the page's
variables `--series-N`, which have one set of values for light mode and one for dark mode.
"""

import io
import re
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

LIGHT = (
    "#c23b2e",
    "#2b6cb0",
    "#1f7a3a",
    "#b7791f",
    "#6b46c1",
    "#0f766e",
    "#be185d",
    "#4b5563",
    "#0e7490",
    "#9a3412",
    "#4d7c0f",
    "#a21caf",
)
DARK = (
    "#ff7b6b",
    "#6cb2ff",
    "#5fd38a",
    "#f2b84b",
    "#b79cff",
    "#3fd0c0",
    "#ff7ab5",
    "#aab4c3",
    "#4cc9e8",
    "#ffab73",
    "#b5d94c",
    "#eb8bf5",
)
INK = "#ab00ff"
"""Placeholder for the colour of the page's text."""
SIZE = (4.9, 2.9)
"""Size of a figure [inch]: about the width of a phone, where its text must be readable."""
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "servobench",
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "axes.grid": True,
    "grid.color": INK,
    "grid.alpha": 0.15,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0,
    "axes.linewidth": 0.7,
    "path.simplify_threshold": 0.3,
}
"""Matplotlib's settings; text from files is never parsed as a formula."""
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def colour(i: int) -> str:
    """Return the placeholder for the colour of series i."""
    return f"#ab00{i % len(LIGHT):02x}"


def css(placeholder: str) -> str:
    """Return the colour in CSS for a placeholder."""
    return "currentColor" if placeholder == INK else f"var(--series-{int(placeholder[-2:], 16)})"


@contextmanager
def canvas(height: float = SIZE[1]) -> Generator[tuple[Figure, Axes]]:
    """Yield a figure with axes; draw it and turn it into SVG within the block."""
    with mpl.rc_context(STYLE), warnings.catch_warnings():
        # The browser has the characters that our font lacks.
        warnings.filterwarnings("ignore", "Glyph")
        figure = Figure(figsize=(SIZE[0], height), layout="constrained")
        axes = figure.subplots()
        axes.set_axisbelow(True)
        yield figure, axes


def svg(figure: Figure, title: str) -> Markup:
    """Return the figure as a scalable SVG element with a label for screen readers."""
    file = io.StringIO()
    figure.savefig(file, format="svg", transparent=True, metadata=NO_METADATA)
    text = file.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"#ab00(?:ff|0[0-9a-f])", lambda found: css(found.group()), text)
    head, rest = text.split(">", 1)
    head = re.sub(r' (?:width|height)="[^"]*"', "", head)
    return Markup(f'{head} role="img" aria-label="{Markup.escape(title)}">{rest}')
