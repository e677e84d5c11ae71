"""One run of a study, from its settings to its row, and the file of a row.

The file is a Parquet table of one row, checked against the study.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.loop.measured_run import measured_run
from servo.loop.run_measures import CONVERGED_PX, MEANINGS, Outcome, violations
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.versions import versions
from servo.scenario.load import Scenario
from servo.scenario.named_files import digest_of
from servo.study.plan import Run, Study
from sim.files import reading
from sim.kinds import UnknownKind
from tracking.drawing.contact_sheet import page, tile
from tracking.drawing.picture_bytes import encoded
from tracking.files.json_text import number
from tracking.sequences.sources import Picture

Row = dict[str, Any]
TILES = 8
JPEG_QUALITY = 80
CAMERA = tuple(f"camera_{axis}_m" for axis in "xyz")
"""The camera's place in the target's frame: x along the nose, y to its right, z into the table."""
CORNERS = tuple(f"corner{i}_{axis}_px" for i in range(4) for axis in "uv")
"""Projected corners of the target's reference rectangle."""
TIMED = ("step_ms", "track_ms")
"""Columns of measured times, which differ when a run is repeated."""


def perform(run: Run) -> Row:
    """Do a run; its row, by column.

    Raises:
        Mistake: A setting is not valid.
    """
    scenario = _parsed(run)
    last = scenario.frames - 1
    wanted = set(np.linspace(0, last, TILES).astype(int)) if run.pictured else set()
    tiles: list[Any] = []

    def keep(step: Step) -> None:
        if step.frame.index in wanted:
            tiles.append(_tile(step))

    steps, report = measured_run(scenario, keep)
    hoped = scenario.expect.get("outcome") or scenario.bounds.success or Outcome.CONVERGED.name
    return {
        "run": run.number,
        "scenario": run.scenario,
        "seed": run.seed,
        **run.settings,
        "repeats": scenario.run.repeats,
        "outcome": report.outcome.name,
        "success": report.outcome.name == hoped,
        "missed": [
            {"name": v.name, "found": _text(v.found), "bound": _text(v.bound)}
            for v in violations(report, scenario.expect)
        ],
        **{m.name: number(m.value) for m in report.measures},
        "track_ms": 1e3 * float(np.median([s.seconds.track for s in steps])),
        **version_columns(),
        **_series(steps),
        "sheet": encoded(page(tiles), JPEG_QUALITY) if tiles else None,
    }


def _parsed(run: Run) -> Scenario:
    """The scenario of a run; where the study began it was right, so a kind is missing here only."""
    for path, digest in run.files.items():
        if digest_of(path) != digest:
            raise Mistake(
                f"on {platform.node()}, the file {path} is not the one that the study began with"
            )
    try:
        return run.parsed()
    except Mistake as error:
        if not isinstance(error.__cause__, UnknownKind):
            raise
        raise Mistake(f"the worker on {platform.node()} lacks a package: {error}") from error


def _text(value: float | str | None) -> str | None:
    return None if value is None else str(value)


def version_columns() -> dict[str, str]:
    """The versions that decide the numbers, by column."""
    return {
        f"version_{name.replace('-', '_').replace(' ', '_')}": version
        for name, version in versions().items()
    }


def _series(steps: list[Step]) -> dict[str, list[Any]]:
    errors = [s.tracking_error for s in steps]
    places = np.array([s.T_object_camera.translation for s in steps])
    corners = np.array([s.truth.corners.ravel() for s in steps])
    return {
        **dict(zip((*CAMERA, *CORNERS), np.hstack([places, corners]).T.tolist(), strict=True)),
        "time_s": [s.frame.time for s in steps],
        "servo_error_px": [s.servo_error for s in steps],
        "tracking_error_px": errors,
        "on_target": [error <= CONVERGED_PX for error in errors],
    }


def _tile(step: Step) -> Any:
    picture = Picture(f"{step.frame.time:.1f} s", step.frame.time, step.frame.image)
    return tile(picture, step.truth.corners, step.estimate.outline(step.region))


FLOATS = pa.list_(pa.float32())
FLAGS = pa.list_(pa.bool_())
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Bounds that a run did not keep; numbers are texts, because a bound on the outcome is a word."""
MOST_BYTES = 100_000_000
SERIES = {
    "time_s": FLOATS,
    "servo_error_px": FLOATS,
    "tracking_error_px": FLOATS,
    "on_target": FLAGS,
    **dict.fromkeys((*CAMERA, *CORNERS), FLOATS),
    "sheet": pa.binary(),
}
"""Columns of a run's own file that are not in the table of all runs."""


class RunFiles:
    """Writes and reads the rows of one study."""

    def __init__(self, study: Study) -> None:
        self._own = columns(study)
        self._schema = pa.schema([*self._own, *SERIES.items()])
        self._types = dict(self._own)

    def encoded(self, row: Row) -> bytes:
        """The file of a row."""
        cells = {f.name: _cell(row.get(f.name), f.type) for f in self._schema}
        return parquet(pa.Table.from_pylist([cells], self._schema))

    def read(self, path: Path) -> pa.Table | None:
        """The row without its long columns; None if the file is not as it was written."""
        try:
            # Read into memory first: the file could change while it is parsed.
            raw = pa.BufferReader(reading.content(path, "row", MOST_BYTES))
            whole = pq.read_table(raw, page_checksum_verification=True)
        except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
            return None  # a file of zeros after a crash, or flipped bits
        if whole.num_rows != 1 or not whole.schema.equals(self._schema):
            return None
        return whole.select([name for name, _ in self._own])

    def fits(self, table: pa.Table, run: Run) -> bool:
        """Whether a row is the result of a run with the versions that are installed now."""
        row = table.to_pylist()[0]
        wanted = {"run": run.number, "scenario": run.base.name, "seed": run.seed}
        wanted |= {k: _cell(v, self._types[k]) for k, v in run.settings.items()}
        return all(row[k] == v for k, v in (wanted | version_columns()).items())


def parquet(table: pa.Table) -> bytes:
    """A table as a Parquet file with checksums."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def columns(study: Study) -> list[tuple[str, pa.DataType]]:
    """Names and types of the columns of the table of all runs."""
    own = [(axis.key, axis.values) for axis in study.every_axis]
    own += [(d.key, d.numbers if d.law == "choice" else (0.5,)) for d in study.draws]
    fixed = [("run", pa.int64()), ("scenario", pa.string()), ("seed", pa.int64())]
    named = {name for name, _ in fixed}
    return [
        *fixed,
        *((key, _type(values)) for key, values in own if key not in named),
        ("repeats", pa.bool_()),
        ("outcome", pa.string()),
        ("success", pa.bool_()),
        ("missed", MISSED),
        *((name, pa.float64()) for name in (*MEANINGS, "track_ms")),
        *((name, pa.string()) for name in version_columns()),
    ]


def _cell(value: Any, kind: pa.DataType) -> Any:
    """A value for a column; values of an axis with mixed types are stored as text."""
    return value if kind != pa.string() or value is None else str(value)


def _type(values: Iterable[Any]) -> pa.DataType:
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
