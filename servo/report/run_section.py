"""The section of an HTML report about a run: measures and bounds, errors over time, pictures,
settings.
"""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from servo.loop.measure import MEASURES, Measure, pose_measures
from servo.loop.run_measures import Outcome
from servo.loop.settings import DOES_NOT_REPEAT
from servo.mistake import Mistake
from servo.output.formats import HALF_WRITTEN, RUN_AGAIN, check_format, content
from servo.output.run_curves import RunCurves
from servo.output.run_folder import RECORDING
from servo.output.steps_table import FORMAT, STREAM, TABLE
from servo.report.charts import ERROR_RANGE, INK, Curve, Scale, colour, curves
from servo.report.page import Block, Fact, Figure, PageImage, Section, again
from servo.report.words import Badge, Table, Tone, shown
from servo.study.bounds import missed_lines
from servo.study.run_report import RunReport
from tracking.drawing.contact_sheet import page, tile
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture as Shown

TILES = 12
OUTCOME = Measure("outcome", "", "how the run ended")
"""The line of the outcome in the table of measures."""
KEY_MEASURES = ("servo_rms_px", "servo_peak_px", "tracking_rms_px", "settle_s", "lost_pct")
TIME = Scale("time [s]")
INKS = {"measured": colour(3), "estimated": colour(2), "true": INK}
"""Colours of the lines of the target's motion."""
SHADED = "Shaded: the tracker was not sure of the target, or the frame was dropped."


def section(folder: Path) -> Section:
    """Return the section of an HTML report about a folder that `servobench run` wrote: measures and
    bounds, errors over time, pictures and settings.

    Raises:
        Mistake: The run is not finished, or a file is missing, damaged or of another format.
    """
    path = folder / RunReport.FILE
    if not path.exists():
        kept = TABLE if (folder / TABLE).exists() else STREAM
        raise Mistake(
            f"{folder}: this run has not ended ({path.name} is missing, {kept} has its rows): wait "
            "for its end or, if it was stopped, run it again into a new folder"
        )
    run = RunReport.read(path)
    known = Outcome.__members__.get(run.outcome)
    kept = f"{len(run.expect) - len(run.missed)} of {len(run.expect)}"
    badge = Badge.of(not run.missed, kept) if run.expect else Badge(kept, Tone.PLAIN)
    facts = [Fact("bounds kept", badge)]
    facts += [
        Fact(MEASURES[name].meaning, f"{shown(run.measures[name])} {MEASURES[name].unit}", name)
        for name in (*pose_measures(len(run.features)), *KEY_MEASURES)
        if run.measures.get(name) is not None
    ]
    facts += [
        Fact(name, f"{shown(used)} Hz", "fits camera.rate") for name, used in run.rates.items()
    ]
    return Section(
        "run",
        f"{run.scenario}, seed {run.seed}",
        known.sentence(run.limits, run.off) if known else "",
        Badge.of(run.outcome == Outcome.CONVERGED.name, run.outcome),
        facts,
        [
            _pictures(folder),
            Block("Over time", figures=_figures(folder, run)),
            _bounds(run),
            _scenario(folder, run),
            again(run),
        ],
        str(folder),
    )


def _bounds(run: RunReport) -> Block:
    missed = {violation.name for violation in run.missed}
    rows: list[list[str | Badge]] = []
    for name, value in {"outcome": run.outcome, **run.measures}.items():
        measure = MEASURES.get(name, OUTCOME)
        bound = run.expect.get(name)
        held = "" if bound is None else Badge.of(name not in missed, "kept", "missed")
        most = (
            f"\N{LESS-THAN OR EQUAL TO} {bound:g}"
            if isinstance(bound, float | int)
            else bound or ""
        )
        rows.append([name, shown(value), measure.unit, most, held, measure.meaning])
    rows.sort(key=lambda row: row[3] == "")
    head = ("measure", "value", "unit", "bound", "", "meaning")
    text = ["Every bound is kept."] if run.expect and not run.missed else []
    if not run.expect:
        text = [run.unjudged or "This scenario has no bounds."]
    if not run.repeats:
        text.append(f"{DOES_NOT_REPEAT}.")
    if run.uncertain:
        text.append(f"{run.uncertain}.")
    table = Table(head, rows, words=(0, 2, 4, 5))
    return Block("Measures and bounds", text, missed_lines(run.missed, run.measures), [table])


def _figures(folder: Path, run: RunReport) -> list[Figure]:
    path = folder / TABLE
    read = RunCurves(_steps(path), run.features, run.feed_forward, str(path))
    time = read["time_s"]
    shown = [read.distances(), read.errors(), *read.motions()]
    note = SHADED if read.unsure.any() else ""
    return [
        curves(
            panel.title,
            TIME,
            Scale(panel.axis, panel.low, panel.high, ERROR_RANGE if i == 0 else None),
            [
                Curve(name, time, values, colour=INKS.get(name, colour(k)), dashed=name == "true")
                for k, (name, values) in enumerate(panel.lines.items())
            ],
            shaded=(time, read.unsure),
            note=note * (i == 0),
        )
        for i, panel in enumerate(shown)
    ]


def _steps(path: Path) -> pa.Table:
    """Return the table of a run's steps from its Parquet file.

    Raises:
        Mistake: The file cannot be read, is half-written, or has another format number.
    """
    raw = pa.BufferReader(content(path))
    try:
        found = pq.read_table(raw, page_checksum_verification=True)
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise Mistake(f"{path}: this table cannot be read; {HALF_WRITTEN}") from None
    written = (found.schema.metadata or {}).get(b"format", b"").decode(errors="replace")
    check_format(path, int(written) if written.isdecimal() else written or None, FORMAT)
    return found


def _pictures(folder: Path) -> Block:
    title = "What the camera saw"
    path = folder / RECORDING
    if not path.exists():
        return Block(title, ["There is no recording in this folder, so there are no pictures."])
    try:
        # Rerun takes half a second to import; before 0.38 it read no recordings.
        from servo.output.recording.recorded_frames import pictures
    except ImportError:
        return Block(
            title, ["To show pictures, install rerun-sdk 0.38 or newer, which can read recordings."]
        )
    found = pictures(path, TILES)
    if not found:
        return Block(title, ["There are no pictures in this recording."])
    tiles = [tile(Shown(f"{p.time:.1f} s", p.time, p.image), p.truth, p.estimate) for p in found]
    sheet = PageImage.of("", encoded(page(tiles)), str(path), sheet=True)
    return Block(title, ["Truth white, estimate green."], pictures=[sheet])


def _scenario(folder: Path, run: RunReport) -> Block:
    try:
        text = tomli_w.dumps(run.table).strip()
    except TypeError:  # TOML has no null
        raise Mistake(
            f"{folder / run.FILE}: the value of table is not the table of a scenario: {RUN_AGAIN}"
        ) from None
    return Block("Scenario", ["As it ran, with all changes."], code=[text], folded=True)
