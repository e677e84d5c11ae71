"""The section about a run: measures and bounds, errors over time, pictures, settings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tomli_w

from servo.loop.run_measures import MEANINGS, Outcome
from servo.mistake import Mistake
from servo.output.run_folder import RECORDING, RunReport
from servo.output.steps_table import FORMAT, STREAM, TABLE, ending, ending_of_rate
from servo.report import files
from servo.report.charts import ERRORS, Curve, Scale, Shade, curves
from servo.report.drawing import INK, colour
from servo.report.page import Block, Fact, Figure, PageImage, Section, again
from servo.report.words import Badge, Table, Tone, shown
from servo.scenario.sections import DOES_NOT_REPEAT
from sim.types import Array
from tracking.drawing.contact_sheet import page, tile
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture as Shown

TILES = 12
KEY_MEASURES = ("servo_rms_px", "servo_peak_px", "tracking_rms_px", "settle_s", "lost_pct")
SHADED = "Shaded: the tracker was not sure of the target, or the frame was dropped."
MIDDLE = (1, 99)
"""Percentiles of the measured motion that its plot shows; outliers may be outside."""


def section(folder: Path) -> Section:
    """The section about the folder of a run.

    Raises:
        Mistake: The run is not finished, or a file is damaged.
    """
    path = folder / RunReport.FILE
    if not path.exists():
        raise Mistake(f"{folder}: this run was not finished: there is {STREAM}, but no {path.name}")
    run = RunReport.read(path)
    known = Outcome.__members__.get(run.outcome)
    kept = len(run.expect) - len(run.missed)
    tone = Tone.PLAIN if not run.expect else Tone.BAD if run.missed else Tone.GOOD
    facts = [Fact("bounds kept", Badge(f"{kept} of {len(run.expect)}", tone))]
    facts += [
        Fact(MEANINGS[name][1], f"{shown(run.measures[name])} {MEANINGS[name][0]}", name)
        for name in KEY_MEASURES
        if run.measures.get(name) is not None
    ]
    facts += [
        Fact(name, f"{shown(used)} Hz", "fits camera.rate") for name, used in run.rates.items()
    ]
    return Section(
        "run",
        f"{run.scenario}, seed {run.seed}",
        known.value if known else "",
        Badge.of(run.outcome == Outcome.CONVERGED.name, run.outcome),
        facts,
        [
            _bounds(run),
            Block("Over time", figures=_figures(folder, run)),
            _pictures(folder),
            _scenario(path, run),
            again(run),
        ],
        str(folder),
    )


def _bounds(run: RunReport) -> Block:
    missed = {violation.name for violation in run.missed}
    rows: list[list[str | Badge]] = []
    for name, value in {"outcome": run.outcome, **run.measures}.items():
        unit, meaning = MEANINGS.get(name, ("", "how the run ended"))
        bound = run.expect.get(name)
        held = "" if bound is None else Badge.of(name not in missed, "kept", "missed")
        most = (
            f"\N{LESS-THAN OR EQUAL TO} {bound:g}"
            if isinstance(bound, float | int)
            else bound or ""
        )
        rows.append([name, shown(value), unit, most, held, meaning])
    rows.sort(key=lambda row: row[3] == "")
    head = ("measure", "value", "unit", "bound", "", "meaning")
    text = ["Every bound is kept."] if run.expect and not run.missed else []
    if not run.expect:
        text = [run.unjudged or "This scenario has no bounds."]
    if run.settings["run"].get("tracker_ms") == "measured":
        text.append(f"{DOES_NOT_REPEAT}.")
    table = Table(head, rows, words=(0, 2, 4, 5))
    return Block("Measures and bounds", text, list(map(str, run.missed)), [table])


def _figures(folder: Path, run: RunReport) -> list[Figure]:
    errors = {name: _column("error", name, ending(unit)) for name, unit in run.features.items()}
    moving = [name for name in run.feed_forward or run.features if name in run.features]
    motions = {
        name: [
            _column(f"motion_{which}", name, ending_of_rate(run.features[name]))
            for which in ("measured", "estimated", "true")
        ]
        for name in moving
    }
    wanted = [
        "time_s",
        "servo_error_px",
        "tracking_error_px",
        "fresh",
        "status",
        *errors.values(),
        *(column for columns in motions.values() for column in columns),
    ]
    table = files.table(folder / TABLE, wanted, FORMAT)
    column = {name: np.asarray(table[name].to_numpy()) for name in wanted}
    time = column["time_s"]
    across = Scale("time [s]")
    unseen = (time, ~(column["fresh"].astype(bool) & (column["status"] == "LOCKED")))
    note = SHADED if unseen[1].any() else ""
    distances = [
        Curve("true centre to goal", time, column["servo_error_px"], colour=colour(0)),
        Curve("estimate to true centre", time, column["tracking_error_px"], colour=colour(1)),
    ]
    parts = [
        Curve(f"{name} [{run.features[name]}]", time, column[error], colour=colour(i))
        for i, (name, error) in enumerate(errors.items())
    ]
    return [
        curves(
            "Distance from goal, and of the estimate",
            across,
            Scale("distance [px]", low=0, log_from=ERRORS),
            distances,
            shaded=unseen,
            note=note,
        ),
        curves("Feature errors", across, Scale("s - s*"), parts, shaded=unseen, note=note),
        *(
            _motion(name, run.features[name], time, [column[c] for c in columns], unseen)
            for name, columns in motions.items()
        ),
    ]


def _column(prefix: str, name: str, ending: str) -> str:
    return "_".join(filter(None, (prefix, name, ending)))


def _motion(name: str, unit: str, time: Array, found: list[Array], unseen: Shade) -> Figure:
    """The figure of the target's own motion in the image: measured, estimated, true."""
    measured, estimated, true = found
    true = true.copy()
    true[:1] = np.nan  # before the first frame there is no motion
    finite = measured[np.isfinite(measured)]
    middle = np.percentile(finite, MIDDLE) if len(finite) else np.zeros(0)
    every = np.concatenate([middle, estimated, true])
    low = float(np.nanmin(every, initial=0))
    high = float(np.nanmax(every, initial=0))
    room = 0.1 * max(high - low, 0.02)
    drawn = [
        Curve("measured", time, measured, colour=colour(3)),
        Curve("estimated", time, estimated, colour=colour(2)),
        Curve("true", time, true, colour=INK, dashed=True),
    ]
    axis = Scale(f"d{name}/dt [{unit}/s]", low - room, high + room)
    return curves(f"The target's own motion: {name}", Scale("time [s]"), axis, drawn, shaded=unseen)


def _pictures(folder: Path) -> Block:
    title = "What the camera saw"
    path = folder / RECORDING
    if not path.exists():
        return Block(title, ["There is no recording in this folder, so there are no pictures."])
    from servo.output.recording.recorded_frames import (
        pictures,
    )  # rerun takes half a second to import

    found = pictures(path, TILES)
    if not found:
        return Block(title, ["There are no pictures in this recording."])
    tiles = [tile(Shown(f"{p.time:.1f} s", p.time, p.image), p.truth, p.estimate) for p in found]
    sheet = PageImage.of("", encoded(page(tiles)), str(path), sheet=True)
    return Block(title, ["Truth white, estimate green."], pictures=[sheet])


def _scenario(path: Path, run: RunReport) -> Block:
    try:
        lines = tomli_w.dumps(run.table)
    except (TypeError, ValueError) as error:
        raise Mistake(f"{path}: table: {error}") from None
    return Block("Scenario", ["As it ran, with all changes."], code=[lines.strip()], folded=True)
