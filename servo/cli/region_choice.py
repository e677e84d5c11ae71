"""The region of `track`: as a text, or drawn by a person in the first picture (`--select`)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from rich.console import Console

from servo.cli.terminal import plain
from servo.mistake import Mistake
from tracking.sequences.sources import Picture
from tracking.types import Region, State

DIGITS = 6
"""Digits of a region's numbers."""


def region_of(text: str) -> tuple[Region, State]:
    """Return the region "X,Y,W,H[,DEG]": top left corner, size, rotation about its centre.

    Raises:
        Mistake: The text has another form.
    """
    try:
        x, y, w, h, *turn = (float(part) for part in text.split(","))
        degrees = turn[0] if len(turn) == 1 else 0.0
        if len(turn) > 1 or not np.isfinite([x, y, w, h, degrees]).all():
            raise ValueError(text)
    except ValueError:
        raise Mistake(f"--region {text}: this should be X,Y,W,H or X,Y,W,H,DEG in px") from None
    return Region(w, h), State(x + w / 2, y + h / 2, float(np.radians(degrees)))


def select(
    source: str, pictures: Iterator[Picture], region: str | None
) -> tuple[str, Iterator[Picture]]:
    """Let a person draw the region in the first picture.

    Returns:
        The region as a text for `region_of`, and all pictures.

    Raises:
        Mistake: There is a region already, the first picture cannot be read, or none was drawn.
        ValueError: The source cannot be read.
    """
    if region is not None:
        raise Mistake("give --region or --select, not both")
    first = next(pictures, None)
    if first is None:
        raise Mistake(f"{source}: there are no pictures in it")
    if first.image is None:
        raise Mistake(f"{first.name}: the first picture cannot be read: {first.reason}")
    from servo.cli import region_page  # jinja2 takes a while to import

    box = region_page.ask(first.image, source, _say)
    if box is None:
        raise Mistake("--select was closed without a region; give --region X,Y,W,H[,DEG]")
    text = ",".join(f"{number:.{DIGITS}g}" for number in (box if box[4] else box[:4]))
    _say(f"--region {text} repeats this choice")
    return text, itertools.chain([first], pictures)


def _say(text: str) -> None:
    plain(Console(stderr=True), text)
