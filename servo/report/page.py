"""What a page is made of, as values, and the one template that writes it."""

from __future__ import annotations

import base64
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib import resources

import cv2
import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from servo.mistake import Mistake
from servo.output.formats import Made
from servo.report.drawing import DARK, LIGHT

TEMPLATE = "page.html.jinja"
JPEG_QUALITY = 82


class Tone(Enum):
    """Whether a word is good or bad news."""

    GOOD = "good"
    BAD = "bad"
    PLAIN = "plain"


@dataclass(frozen=True, slots=True)
class Badge:
    """A word in colour."""

    text: str
    tone: Tone

    @staticmethod
    def of(held: bool, good: str, bad: str) -> Badge:
        """One of two words."""
        return Badge(good, Tone.GOOD) if held else Badge(bad, Tone.BAD)


Cell = str | Badge


@dataclass(frozen=True, slots=True)
class Fact:
    """A number that sums up, with what it is."""

    label: str
    value: Cell
    note: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a head; the columns in `words` are words, the others numbers."""

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    words: Collection[int] = (0,)
    note: str = ""


@dataclass(frozen=True, slots=True)
class Key:
    """What a colour of a figure stands for."""

    label: str
    colour: str
    """In CSS."""
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing."""

    title: str
    svg: Markup
    keys: Sequence[Key] = ()
    note: str = ""


@dataclass(frozen=True, slots=True)
class PageImage:
    """An image that is part of the page."""

    title: str
    uri: str
    width: int
    height: int
    """[px]."""
    sheet: bool = True
    """A contact sheet stays wide enough to see something; a plot fits the page."""

    @staticmethod
    def of(title: str, encoded: bytes, place: str, *, sheet: bool) -> PageImage:
        """A PNG or JPEG file as it is; a sheet becomes a JPEG.

        Raises:
            Mistake: It is neither; place names it.
        """
        raw = np.frombuffer(encoded, np.uint8)
        image = cv2.imdecode(raw, cv2.IMREAD_COLOR) if len(raw) else None
        if image is None:
            raise Mistake(f"{place}: this is no picture; it may be half-written")
        height, width = image.shape[:2]
        is_jpeg = encoded.startswith(b"\xff\xd8")
        if sheet and not is_jpeg:
            quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
            encoded, is_jpeg = cv2.imencode(".jpg", image, quality)[1].tobytes(), True
        text = base64.b64encode(encoded).decode("ascii")
        kind = "jpeg" if is_jpeg else "png"
        return PageImage(title, f"data:image/{kind};base64,{text}", width, height, sheet)


@dataclass(frozen=True, slots=True)
class Block:
    """Some of a section under a heading; what is empty is left out."""

    title: str
    text: Sequence[str] = ()
    points: Sequence[str] = ()
    """Sentences, one a line."""
    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    pictures: Sequence[PageImage] = ()
    code: Sequence[str] = ()
    folded: bool = False
    """Opened by the reader."""


@dataclass(frozen=True, slots=True)
class Section:
    """All about one folder."""

    kind: str
    """Such as "run"."""
    title: str
    lead: str
    verdict: Badge
    facts: Sequence[Fact]
    blocks: Sequence[Block]
    folder: str


def again(made: Made) -> Block:
    """How a file was made: the versions, and the command line."""
    table = Table(("package", "version"), list(made.versions.items()), words=range(2))
    if not made.command:
        return Block("Again", ["This was made from Python, not by a command."], tables=[table])
    return Block("Again", tables=[table], code=[made.command])


def render(sections: Sequence[Section]) -> str:
    """The page, complete."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = resources.files("servo.report").joinpath(TEMPLATE).read_text(encoding="utf-8")
    return environment.from_string(text).render(sections=sections, light=LIGHT, dark=DARK)
