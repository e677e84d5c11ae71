"""The summary that `servobench track` prints at its end."""

from __future__ import annotations

import itertools

import numpy as np
from rich.console import Console
from rich.markup import escape

from servo.cli.terminal import complain, print_table
from servo.report.words import Table
from tracking.evaluation.track import Shot
from tracking.evaluation.track_measures import MEASURES, Comparison
from tracking.sequences.sources import End
from tracking.types import Status


def print_track(
    console: Console, what: str, seen: list[Shot], comparison: Comparison | None, end: End | None
) -> None:
    """Print what was tracked, its measures where there is a truth, and what was odd."""
    lost = sum(shot.estimate.status is Status.LOST for shot in seen)
    console.print(f"[bold]{escape(what)}[/]: {len(seen)} frames, {lost} LOST")
    if comparison is not None:
        _print_measures(console, comparison)
    print_oddities(seen, end)


def _print_measures(console: Console, comparison: Comparison) -> None:
    found = ((m, m.of(comparison)) for m in MEASURES)
    rows = [
        [m.name, f"{value:.3g} {m.unit}".rstrip(), m.better.value, m.meaning]
        for m, value in found
        if np.isfinite(value)
    ]
    print_table(console, Table(("measure", "value", "better", "meaning"), rows, (0, 2, 3)))


def print_oddities(seen: list[Shot], end: End | None) -> None:
    """Print what the user should know of the pictures, and how a stream ended."""
    blind = [shot.picture for shot in seen if shot.blind]
    sizes = [shot for shot in seen if shot.size is not None]
    change = next((b for a, b in itertools.pairwise(sizes) if a.size != b.size), None)
    if change is not None and change.size is not None:
        width, height = change.size
        complain(
            f"the pictures change their size at {change.picture.name} to {width} x {height} px; "
            "the target is searched for at the same pixels"
        )
    if blind:
        complain(
            f"{len(blind)} of {len(seen)} pictures cannot be read, the first is "
            f"{blind[0].name} ({blind[0].reason}); their rows are LOST"
        )
    if end is not None:
        complain(end.sentence)
