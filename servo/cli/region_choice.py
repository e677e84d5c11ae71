"""`--select`: a person draws the region in the first picture, in a window or on a local page."""

from __future__ import annotations

import os
import sys

from rich.console import Console

from servo.cli import region_page, region_window
from servo.cli.terminal import plain
from servo.mistake import Mistake
from sim.types import Image

DIGITS = 6
"""Digits of a region's numbers."""
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
Box = tuple[float, float, float, float, float]
"""Left, top, width, height [px], and rotation about the centre [deg]."""


def chosen(image: Image, name: str) -> str:
    """The region that a person draws, as `--region` takes it: "X,Y,W,H,DEG".

    Raises:
        Mistake: Nothing was drawn.
    """
    window = region_window.opened(image, name) if _has_desktop() else None
    box = window() if window is not None else region_page.ask(image, name, _say)
    if box is None:
        raise Mistake("--select was closed without a region; give --region X,Y,W,H[,DEG]")
    text = ",".join(f"{number:.{DIGITS}g}" for number in (box if box[4] else box[:4]))
    _say(f"--region {text} repeats this choice")
    return text


def _has_desktop() -> bool:
    return sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in DISPLAYS)


def _say(text: str) -> None:
    plain(Console(stderr=True), text)
