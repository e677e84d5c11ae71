"""The parts of an HTML report (sections, blocks, figures, pictures) as dataclasses, and the HTML of
the whole page.
"""

import base64
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from servo.mistake import Mistake
from servo.output.formats import HALF_WRITTEN, Made, content
from servo.report.words import Badge, Cell, Table, cut

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
"""Colours of the series of a figure, on light and on dark ground."""
JPEG = b"\xff\xd8"
"""First bytes of a JPEG file."""
JPEG_QUALITY = 82
MOST_ROWS = 500
"""Most rows of a table on a page; files have all rows."""


@dataclass(frozen=True, slots=True)
class Fact:
    """A number or word at the head of a section of an HTML report, with a label and a note."""

    label: str
    value: Cell
    note: str = ""


@dataclass(frozen=True, slots=True)
class Key:
    """An entry of a figure's legend: label, colour (of CSS), and whether the line is dashed."""

    label: str
    colour: str
    """A colour of CSS."""
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of an HTML report: an SVG element, with title, legend (`keys`), a note, and
    Matplotlib's figure (`drawing`) for files.
    """

    title: str
    svg: Markup
    keys: Sequence[Key] = ()
    note: str = ""
    drawing: Drawing | None = None
    """Matplotlib's figure, for files."""


@dataclass(frozen=True, slots=True)
class PageImage:
    """A picture that is embedded in an HTML report as a data URI (`uri`), with its width and height
    [px]. A contact sheet (`sheet`) keeps a minimum width; any other picture is fitted to the page.
    """

    title: str
    uri: str
    width: int
    height: int
    """Size of the picture [px]."""
    sheet: bool = True
    """Whether it is a contact sheet, which keeps a minimum width; a plot is fitted to the page."""

    @staticmethod
    def read(path: Path, title: str = "", *, sheet: bool = False) -> "PageImage":
        """Return the picture in a PNG or JPEG file.

        Args:
            path: The file.
            title: Title of the picture.
            sheet: Whether it is a contact sheet, which becomes a JPEG.

        Raises:
            Mistake: The file is missing or is no picture.
        """
        return PageImage.of(title, content(path), str(path), sheet=sheet)

    @staticmethod
    def of(title: str, encoded: bytes, place: str, *, sheet: bool) -> "PageImage":
        """Return the picture that the bytes of a PNG or JPEG file hold, to be embedded in an HTML
        report.

        Args:
            title: Title of the picture.
            encoded: Content of a PNG or JPEG file.
            place: Name of the picture in the message of an error.
            sheet: Whether it is a contact sheet, which becomes a JPEG.

        Raises:
            Mistake: The bytes are no picture.
        """
        raw = np.frombuffer(encoded, np.uint8)
        image = cv2.imdecode(raw, cv2.IMREAD_COLOR) if len(raw) else None
        if image is None:
            raise Mistake(f"{place}: this is not a picture; {HALF_WRITTEN}")
        height, width = image.shape[:2]
        if sheet and not encoded.startswith(JPEG):
            quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
            encoded = cv2.imencode(".jpg", image, quality)[1].tobytes()
        text = base64.b64encode(encoded).decode("ascii")
        kind = "jpeg" if encoded.startswith(JPEG) else "png"
        return PageImage(title, f"data:image/{kind};base64,{text}", width, height, sheet)


@dataclass(frozen=True, slots=True)
class Block:
    """A part of a section of an HTML report, under a heading: texts, a list (`points`), code,
    tables, figures and pictures. If `folded`, it is closed until the reader opens it.
    """

    title: str
    text: Sequence[str] = ()
    points: Sequence[str] = ()
    """Items of a list."""
    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    pictures: Sequence[PageImage] = ()
    code: Sequence[str] = ()
    folded: bool = False
    """Closed until the reader opens it."""


@dataclass(frozen=True, slots=True)
class Section:
    """The part of an HTML report about one folder of results: the command that wrote the folder
    (`kind`), title, introduction (`lead`), verdict, facts and blocks.
    """

    kind: str
    """The command that wrote the folder, such as "run", or what the section shows without one."""
    title: str
    lead: str
    verdict: Badge
    facts: Sequence[Fact]
    blocks: Sequence[Block]
    folder: str
    """The folder of the results; "": none."""


def again(made: Made) -> Block:
    """Return the block "Again" of a report, which says how results were made: the command line, if
    they were made by a command, and the versions of the packages.
    """
    table = Table(("package", "version"), list(made.versions.items()), words=range(2))
    if not made.command:
        return Block("Again", ["This was made from Python, not by a command."], tables=[table])
    return Block("Again", tables=[table], code=[made.command])


def rows_of(
    what: str, head: Sequence[str], rows: Iterable[list[str]], count: int, words: Collection[int]
) -> Block:
    """Return a block of a report with a table of the first 500 rows; the block is closed until the
    reader opens it.

    Args:
        what: Plural noun for the rows, such as "runs": the title.
        head: Titles of the columns.
        rows: The rows.
        count: Number of all rows.
        words: Numbers (from 0) of the columns that are texts.
    """
    table = Table(head, list(islice(rows, MOST_ROWS)), words)
    text = filter(None, [cut(what, range(count), MOST_ROWS)])
    return Block(what.capitalize(), list(text), tables=[table], folded=True)


def template(name: str, **filters: Callable[[str], str]) -> Template:
    """Return a Jinja template of the folder servo/report. Values are escaped in templates of HTML.

    Args:
        name: Name of the template's file, such as "page.html.jinja".
        **filters: Functions that the template can use as filters, by name.
    """
    environment = Environment(
        autoescape=".html" in name, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(filters)
    text = resources.files("servo.report").joinpath(name).read_text(encoding="utf-8")
    return environment.from_string(text)


def render(sections: Sequence[Section]) -> str:
    """Return the HTML of a whole report, a page on its own, with the given sections."""
    return template("page.html.jinja").render(sections=sections, light=LIGHT, dark=DARK)
