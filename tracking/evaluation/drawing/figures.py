"""What all drawings of matplotlib share: how they are written, and texts without formulas."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from tracking.files import atomic

DOTS = 130
"""Resolution of a figure [dots per inch]."""


def literal(text: str) -> str:
    """A text as matplotlib draws it unchanged: a dollar begins no formula."""
    return text.replace("$", r"\$")


def save(figure: Figure, folder: Path, name: str) -> Path:
    """Write a figure as a PNG file into a folder; its path.

    Raises:
        OSError: The disk refuses.
    """
    with atomic.writing(folder, name) as file:
        figure.savefig(file, format="png", dpi=DOTS)
    return folder / name
