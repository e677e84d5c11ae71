"""Fixtures that compare a value with one that was looked at, and what a figure draws as values."""

import dataclasses
import enum
import functools
import json
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest

KEPT = Path(__file__).parents[1] / "data" / "approved"
APPROVE = "SERVOBENCH_APPROVE"
DIGITS = 9
"""Digits of a number that are compared: the last of sixteen depend on the processor."""
WHOLE = re.compile(r"-?\d+\.\d{10,}(e[+-]?\d+)?")
"""A number in a text with all of its digits."""


def as_json(value):
    """A value as JSON has it: what has no name there becomes lists, tables, numbers and words."""
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.ndarray | list | tuple | range):
        return [as_json(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, int | type(None)):
        return value
    return WHOLE.sub(lambda found: f"{float(found[0]):.{DIGITS}g}", str(value))


def difference(found, kept, tolerance, at=""):
    """Where two values as JSON first differ, in words; None where they agree."""
    if isinstance(found, list) and isinstance(kept, list) and len(found) == len(kept):
        found, kept = dict(enumerate(found)), dict(enumerate(kept))
    if isinstance(found, dict) and isinstance(kept, dict):
        if found.keys() != kept.keys():
            return f"{at}: only in one of the two: {sorted(map(str, found.keys() ^ kept.keys()))}"
        pairs = ((found[k], kept[k], f"{at}/{k}") for k in found)
        return next(filter(None, (difference(f, k, tolerance, a) for f, k, a in pairs)), None)
    numbers = all(isinstance(value, int | float) for value in (found, kept))
    if numbers and float in (type(found), type(kept)):
        near = math.isclose(found, kept, rel_tol=tolerance, abs_tol=tolerance / 100)
        alike = near or (math.isnan(found) and math.isnan(kept))
    else:
        alike = found == kept and type(found) is type(kept)
    return None if alike else f"{at}: {found!r} instead of {kept!r}"


@pytest.fixture
def approved():
    """Compares a value with the one in tests/data/approved, to a relative tolerance.

    Where a change is meant, SERVOBENCH_APPROVE=1 in the environment writes the new value; look at
    what git says has changed.
    """

    def compare(name, value, tolerance=1e-6):
        path, found = KEPT / f"{name}.json", as_json(value)
        if os.environ.get(APPROVE):
            path.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(found, indent=1, ensure_ascii=False)
            text = re.sub(r"\[\s+[^][{}]+\s\]", lambda row: re.sub(r"\n\s*", " ", row[0]), text)
            path.write_text(text + "\n")
        differs = difference(found, json.loads(path.read_text()), tolerance)
        assert differs is None, f"{name}{differs} (if that is meant: {APPROVE}=1)"

    return compare


@pytest.fixture
def drawn():
    """What a Matplotlib figure shows, as plain values: axes, words, lines, bars, areas, colours."""
    from matplotlib.colors import to_hex

    shade = functools.partial(to_hex, keep_alpha=True)

    def of_axes(ax):
        for area in ax.collections:
            area.update_scalarmappable()  # else a map of colours has none before it is drawn
        legend = ax.get_legend()
        assert not (legend and legend.get_frame_on()), "the frame of a legend hides curves"
        ticks = (*ax.get_xticklabels(), *ax.get_yticklabels())
        return {
            "words": [ax.get_title() or ax.get_title("left"), ax.get_xlabel(), ax.get_ylabel()],
            "limits": [*ax.get_xlim(), *ax.get_ylim()],
            "scales": [ax.get_xscale(), ax.get_yscale()],
            "frame": [shade(ax.get_facecolor()), *(s.get_visible() for s in ax.spines.values())],
            "ticks": [t.get_text() for t in ticks],
            "letters": sorted({(t.get_rotation(), t.get_fontsize()) for t in ticks}),
            "grids": [
                [
                    tick.tick1line.get_markersize(),
                    tick.gridline.get_visible(),
                    tick.gridline.get_alpha(),
                ]
                for tick in (ax.xaxis.majorTicks[0], ax.yaxis.majorTicks[0])
            ],
            "lines": [
                [
                    line.get_xydata(),
                    to_hex(line.get_color()),
                    line.get_linewidth(),
                    line.get_linestyle(),
                    str(line.get_marker()),
                ]
                for line in ax.lines
            ],
            "marks": [
                [line.get_markersize(), line.get_alpha(), line.get_zorder()] for line in ax.lines
            ],
            "areas": [[p.vertices for p in area.get_paths()] for area in ax.collections],
            "points": [np.asarray(area.get_offsets()) for area in ax.collections],
            "fills": [
                f"{shade(colour)} {width:g}"
                for area in ax.collections
                for i, colour in enumerate(area.get_facecolor())
                for width in [area.get_linewidth()[i % len(area.get_linewidth())]]
            ],
            "bars": [
                [
                    p.get_path().get_extents(p.get_patch_transform()).extents,
                    to_hex(p.get_facecolor()),
                ]
                for p in ax.patches
            ],
            "rims": sorted({p.get_linewidth() for p in ax.patches}),
            "texts": [[t.get_text(), t.get_position()] for t in ax.texts],
            "inks": [t.get_color() for t in ax.texts],
            "places": sorted({(t.get_fontsize(), t.get_ha(), t.get_va()) for t in ax.texts}),
            "legend": legend and [[t.get_text(), t.get_fontsize()] for t in legend.get_texts()],
        }

    def of(figure):
        figure.draw_without_rendering()
        return {"inches": figure.get_size_inches(), "axes": [of_axes(ax) for ax in figure.axes]}

    return of


@pytest.fixture
def section(monkeypatch, drawn, tmp_path):
    """All that `servobench report` says of a folder; figures and pictures as plain values."""
    from servo.cli import report_command
    from servo.report import charts

    monkeypatch.setattr(charts, "svg", lambda figure, title: [title, drawn(figure)])

    def plain(value):
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        if isinstance(value, list):
            return [plain(item) for item in value]
        if isinstance(value, str):
            return value.split(";base64")[0].replace(str(tmp_path), "FOLDER")
        return value

    def said(folder):
        found = []
        monkeypatch.setattr(report_command, "render", lambda sections: found.extend(sections) or "")
        report_command.write([folder], tmp_path / "section.html")
        return plain(as_json(found[0]))

    return said
