"""The figures of an HTML report as SVG: curves and heat maps.

The background is transparent. Matplotlib draws with the colours of light mode, which are also those
of files to print. In the page's SVG these colours are replaced by `currentColor` and by the page's
variables `--series-N`, which have other values in dark mode.
"""

import io
import re
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure as Drawing
from numpy.typing import NDArray

from servo.mistake import Mistake
from servo.report.page import LIGHT, Figure, Key
from servo.report.words import shown
from sim.types import Array
from tracking.drawing.figures import ROUNDING, hide_rounding, plain_logarithm

# Chosen by hand, looking at pages of the shipped studies on a phone and on a screen.
ERROR_RANGE = 50.0
SETTING_RANGE = 10.0
"""Errors and settings that differ by more than this factor are drawn on a logarithmic axis."""
DEEPEST = 1e3
"""Largest ratio of the values between the ends of a logarithmic axis; lower values are cut off."""
MARGIN = 1.15
"""Factor by which a logarithmic axis reaches beyond the values."""
FRAME_HEIGHT = 0.7
"""Height of a heat map without its rows [inch]."""
MOST_NUMBERED_COLUMNS = 12
"""Most columns of a heat map with numbers in its cells."""
WIDEST_NAMES = 45
"""Most characters in the names of all columns; longer names are turned."""
LUMINANCE = 0.2126, 0.7152, 0.0722
"""Shares of linear red, green and blue in the relative luminance of a colour (WCAG 2.2)."""
MIDDLE = 0.179
"""Relative luminance on which white and black text have the same contrast, 4.6 to 1."""
BAND_OPACITY = 0.18
FAINT_OPACITY = 0.25
THINNEST = 0.003
"""Share of the thinnest part of a bar that is drawn."""
INK = "#1b1f26"
"""Colour of the page's text in light mode."""
INKS = {INK: "currentColor"} | {one: f"var(--series-{i})" for i, one in enumerate(LIGHT)}
"""Colours of CSS by those that are drawn; no colour of a heat map is one of these."""
SIZE = (4.9, 2.9)
"""Size of a figure [inch]: about the width of a phone, where its text must be readable."""
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "text.parse_math": False,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
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
"""Matplotlib's settings; text from files is never parsed as a formula, and a PDF has its fonts."""

Shade = tuple[Array, NDArray[np.bool_]]
"""Times (n,), and flags (n,): where they are true, a figure is shaded."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A line through n points (x, y) of a figure, with an optional shaded band from `low` to `high`
    (n,), and its style.
    """

    label: str
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    colour: str = INK
    dashed: bool = False
    faint: bool = False
    """Whether the line is pale and has no entry in the legend."""
    points: bool = False
    """Whether points with error bars are drawn in place of a line with a band."""
    marks: bool = False
    """Whether points without a line are drawn."""


@dataclass(frozen=True, slots=True)
class Scale:
    """An axis of a figure: its title, its limits `low` and `high` (None: those of the values), and
    when it is logarithmic: if the ratio of the largest to the lower quartile of the positive values
    is above `log_from` (None: never). A logarithmic axis ignores the limits.
    """

    title: str
    low: float | None = None
    high: float | None = None
    log_from: float | None = None
    """Ratio of the values above which the axis is logarithmic; None: never."""


def curves(
    title: str,
    x: Scale,
    y: Scale,
    drawn: Sequence[Curve],
    *,
    shaded: Shade | None = None,
    note: str = "",
) -> Figure:
    """Return a figure of lines over a common axis. Its legend has all lines that are not faint; a
    single line only if it is dashed.

    Args:
        title: Title of the figure.
        x: The horizontal axis.
        y: The vertical axis.
        drawn: The lines.
        shaded: Times (n,) and flags (n,); the figure is shaded where the flags are True. None: no
            shade.
        note: Text below the figure.
    """
    with _canvas() as (figure, axes):
        for curve in drawn:
            _draw(axes, curve)
        if shaded is not None:
            time, flags = shaded
            axes.fill_between(
                time,
                0,
                1,
                where=flags.tolist(),
                transform=axes.get_xaxis_transform(),
                color=INK,
                alpha=0.1,
                lw=0,
            )
        axes.set(xlabel=x.title, ylabel=y.title)
        _scale(axes, x, [c.x for c in drawn], "x")
        ends = [v for c in drawn for v in (c.low, c.high) if v is not None]
        _scale(axes, y, [c.y for c in drawn], "y", ends)
        if any(c.points or c.marks for c in drawn):
            axes.margins(x=0.05)
        named = [c for c in drawn if not c.faint and (len(drawn) > 1 or c.dashed)]
        keys = [Key(c.label, INKS[c.colour], c.dashed) for c in named]
        return Figure(title, svg(figure, title), keys, note, figure)


def heat(
    title: str,
    x: str,
    y: str,
    columns: Sequence[str],
    rows: Sequence[str],
    values: Array,
    *,
    limits: tuple[float, float] | None = None,
    log_from: float = np.inf,
    note: str = "",
) -> Figure:
    """Return a figure of a table of values as colours. With at most 12 columns the values stand in
    the cells.

    Args:
        title: Title of the figure.
        x: Title of the columns.
        y: Title of the rows.
        columns: Names of the columns.
        rows: Names of the rows, from below.
        values: Values (rows, columns); a cell that is nan stays empty.
        limits: Values of the first and the last colour; None: the least and the largest value.
        log_from: Colours are logarithmic if all values are above 0, and the ratio of the largest to
            the lower quartile is above this number.
        note: Text below the figure.
    """
    finite = values[np.isfinite(values)] if np.isfinite(values).any() else np.array([0.0, 1.0])
    low, high = limits or (float(finite.min()), float(finite.max()))
    logarithmic = finite.min() > 0 and _range(finite) > log_from
    norm = LogNorm(low, high) if logarithmic else Normalize(low, high)
    row_height = max(0.3, min(0.5, 3.0 / len(rows)))
    with _canvas(FRAME_HEIGHT + row_height * max(3, len(rows))) as (figure, axes):
        axes.grid(visible=False)
        cells = axes.pcolormesh(values, norm=norm, cmap="viridis")
        if len(columns) <= MOST_NUMBERED_COLUMNS:
            for (row, column), value in np.ndenumerate(values):
                if np.isfinite(value):
                    axes.text(
                        column + 0.5,
                        row + 0.5,
                        shown(float(value)),
                        ha="center",
                        va="center",
                        fontsize=8,
                        color=_readable_on(np.array(cells.cmap(norm(value)))),
                    )
        angle = 60 if sum(map(len, columns)) > WIDEST_NAMES else 0
        axes.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=angle)
        axes.set_yticks(np.arange(len(rows)) + 0.5, rows)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set(xlabel=x, ylabel=y)
        return Figure(title, svg(figure, title), note=note, drawing=figure)


def _readable_on(cell: Array) -> str:
    """Return the colour of text, white or black, that has the higher contrast on the colour of a
    cell (4,): red, green, blue and opacity, 0 to 1.
    """
    coded = cell[:3]
    # sRGB's curve (IEC 61966-2-1)
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return "white" if linear @ LUMINANCE < MIDDLE else "black"


def stacked(
    title: str, bars: Sequence[str], names: Sequence[str], shares: Array, *, note: str = ""
) -> Figure:
    """Return a figure of horizontal bars of one length that are divided into parts.

    Args:
        title: Title of the figure.
        bars: Labels of the bars, from above.
        names: Names of the parts; one whose share is at most 0.003 in each bar is not drawn.
        shares: Share of each part in each bar (parts, bars), 0 to 1.
        note: Text below the figure.
    """
    with _canvas() as (figure, axes):
        left = np.zeros(len(bars))
        parts = [part for part in zip(names, shares, strict=True) if part[1].max() > THINNEST]
        for i, (name, row) in enumerate(parts):
            axes.barh(bars, 100 * row, left=left, color=colour(i), label=name, height=0.6)
            left += 100 * row
        axes.invert_yaxis()
        axes.set(xlabel="share of the mean square error [%]", xlim=(0, 100))
        axes.grid(visible=False, axis="y")
        keys = [Key(name, INKS[colour(i)]) for i, (name, _) in enumerate(parts)]
        return Figure(title, svg(figure, title), keys, note, figure)


def _draw(axes: Axes, curve: Curve) -> None:
    ends = None if curve.low is None or curve.high is None else (curve.low, curve.high)
    if curve.points and ends is not None:
        bars = np.maximum([curve.y - ends[0], ends[1] - curve.y], 0)
        axes.errorbar(
            curve.x,
            curve.y,
            yerr=bars,
            fmt="o-",
            ms=3.5,
            lw=1.4,
            capsize=2,
            color=curve.colour,
            label=curve.label,
        )
        return
    if ends is not None:
        axes.fill_between(curve.x, *ends, color=curve.colour, alpha=BAND_OPACITY, lw=0)
    dashes = "--" if curve.dashed else "-"
    width = 1.0 if curve.dashed or curve.faint else 1.5
    opacity = FAINT_OPACITY if curve.faint else None
    label = None if curve.faint else curve.label  # a legend names what is told apart
    if curve.marks:
        axes.plot(curve.x, curve.y, "o", color=curve.colour, ms=4, alpha=opacity, label=label)
        return
    axes.plot(curve.x, curve.y, dashes, color=curve.colour, lw=width, alpha=opacity, label=label)


def _scale(
    axes: Axes,
    scale: Scale,
    values: Sequence[Array],
    which: Literal["x", "y"],
    ends: Sequence[Array] = (),
) -> None:
    """Set the limits of an axis; make it logarithmic, with limits from the values, if the ratio of
    the largest to the lower quartile of the positive values is above `scale.log_from`. `ends` are
    ends of intervals: a long interval hides no value.
    """
    drawn = _above_rounding(values)
    above = _above_rounding([*values, *ends])
    if scale.log_from is not None and len(above) and _range(above) > scale.log_from:
        deepest = drawn.max(initial=above.min()) / DEEPEST
        limits = (max(above.min(), deepest) / MARGIN, above.max() * MARGIN)
        axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
        plain_logarithm(axes.xaxis if which == "x" else axes.yaxis)
    elif scale.low is not None or scale.high is not None:
        axes.set(**{f"{which}lim": (scale.low, scale.high)})
    if which == "y" and scale.high is None:
        hide_rounding(axes)


def _above_rounding(values: Sequence[Array]) -> Array:
    every = np.concatenate([np.zeros(0), *values])
    return every[np.isfinite(every) & (every > ROUNDING)]


def _range(values: Array) -> float:
    """Return the ratio of the largest value to the lower quartile, on which a few values near 0
    have no influence.
    """
    return float(values.max() / np.percentile(values, 25))


def colour(i: int) -> str:
    """Return the colour (#rrggbb) of curve number i, from 0; the list of colours is repeated for
    more curves.
    """
    return LIGHT[i % len(LIGHT)]


@contextmanager
def styled() -> Generator[None]:
    """Context manager that gives Matplotlib the style of reports' figures within its block, and
    hides Matplotlib's warnings about characters that the font lacks.
    """
    with mpl.rc_context(STYLE), warnings.catch_warnings():
        # The browser has the characters that our font lacks.
        warnings.filterwarnings("ignore", "Glyph")
        yield


@contextmanager
def _canvas(height: float = SIZE[1]) -> Generator[tuple[Drawing, Axes]]:
    """Yield an empty figure of this height [inch] and its axes, styled within the `with` block."""
    with styled():
        figure = Drawing(figsize=(SIZE[0], height), layout="constrained")
        axes = figure.subplots()
        axes.set_axisbelow(True)
        yield figure, axes


def svg(figure: Drawing, title: str) -> Markup:
    """Return a Matplotlib figure as an SVG element for an HTML page: it scales with the page,
    follows the page's dark mode, and has `title` as its label for screen readers.
    """
    file = io.StringIO()
    figure.savefig(
        file,
        format="svg",
        transparent=True,
        metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")),
    )
    text = file.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub("|".join(INKS), lambda found: INKS[found.group()], text)
    head, rest = text.split(">", 1)
    head = re.sub(r' (?:width|height)="[^"]*"', "", head)
    return Markup(f'{head} role="img" aria-label="{Markup.escape(title)}">{rest}')


def saved(figure: Figure, kind: str, width: float | None = None) -> bytes:
    """Return the content of a file with a figure of a report and its legend. The figure's drawing
    gets the width and the legend, and keeps them.

    Args:
        figure: A figure that has a drawing.
        kind: Format of the file: pdf, svg, pgf or png.
        width: Width before the margins are cut off [inch]; None: that on the page. Texts keep their
            size.

    Raises:
        Mistake: A PGF needs TeX, which is not installed.
    """
    assert figure.drawing is not None
    file = io.BytesIO()
    dated = {"pdf": "CreationDate", "svg": "Date"}
    if width is not None:
        figure.drawing.set_figwidth(width)
    with styled():
        if figure.keys and not figure.drawing.legends:
            figure.drawing.legend(loc="outside upper left", ncols=3, frameon=False)
        try:
            figure.drawing.savefig(
                file,
                format=kind,
                metadata={dated[kind]: None} if kind in dated else None,
                # Its whole width: words beside a drawing in space are no part of its layout.
                bbox_inches="tight",
            )
        except (RuntimeError, FileNotFoundError) as error:
            raise Mistake(
                "a PGF figure needs TeX (xelatex), which does not work here: install it, or choose "
                f"pdf or svg: {error}"
            ) from None
    return file.getvalue()
