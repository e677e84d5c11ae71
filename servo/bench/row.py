"""The published results of a contestant in a benchmark (one row of the benchmark's table), as a
JSON file.
"""

import hashlib
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Len
from pydantic import BeforeValidator, StringConstraints

from servo.bench.benchmark import (
    FARTHEST,
    FOLDER,
    NEAR_DEG,
    NEAR_MM,
    Band,
    Benchmark,
    Settings,
    condition_of,
)
from servo.bench.contestant import Contestant, Division
from servo.bench.world_run import CONTESTANT, OVERLAP, SLOW, WITHIN, WORLD
from servo.bench.world_score import (
    DIGITS,
    ERROR,
    Share,
    WorldScore,
    is_within,
    score_errors,
    world_score,
)
from servo.mistake import Mistake
from servo.output.formats import Made
from servo.output.versions import versions
from servo.study.run import Record, grouped_by
from servo.study.scenario_run import TRACK_MS
from sim.types import Array
from tracking.files.json_text import json_line

TAUS = np.linspace(0.0, FARTHEST, 41)
"""The distances of a row's curve [target sizes]."""
MEASURES = (
    "end_position_mm",
    "end_rotation_deg",
    "settle_s",
    "camera_path_m",
    "camera_turn_deg",
    "retreat_m",
    "out_of_view_pct",
    "excursion_px",
)
"""Measures of a law's row, median over its worlds."""

Digest = Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
Milliseconds = Annotated[str, StringConstraints(pattern=r"^\d{1,6}(\.\d{1,6})?$")]


def by_world(columns: Any) -> dict[str, dict[str, object]]:
    """Return the lines of the table of worlds in a row's file, by the world's name.

    Args:
        columns: The table's columns by their names, as JSON has them.

    Raises:
        ValueError: They are not columns of equal length, or the column "world" is missing.
    """
    try:
        lines = list(zip(*columns.values(), strict=True))
        tables = [dict(zip(columns, line, strict=True)) for line in lines]
        return {str(table.pop("world")): table for table in tables}
    except (AttributeError, TypeError, ValueError, KeyError):
        raise ValueError(
            "columns of equal length are needed: world, area, held and, if known, picture, last"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Made):
    """The published results of a contestant (one row of a benchmark's table), as the contestant's
    JSON file has them: its result in each world (random scenario) of the set `band`, with the
    contestant's settings and digest, and the benchmark's hash. `track_ms` is the tracker's median
    time for a picture [ms]; `slow` the share of worlds held, by the time [ms] of the slowed
    tracker; `curve` the share of pictures with an error of at most tau, for each tau in `TAUS`; and
    `measures` further measures, medians or means over the worlds.
    """

    KIND: ClassVar[str] = "benchmark row"
    FORMAT: ClassVar[int] = 2

    benchmark: str
    hash: str
    """Hash of the benchmark's version."""
    band: Literal["dev", "v1", "sealed"]
    value: str = ""
    """The public value from which sealed worlds were drawn; "" for public worlds."""
    contestant: str
    division: str
    """Name of the division."""
    settings: Settings
    resolved: Settings = field(default_factory=Settings)
    """Every setting of its tables, defaults included; empty in older rows."""
    digest: Digest
    """Digest of the contestant."""
    machine: str
    track_ms: float
    """Median of the tracker's measured times for a picture on `machine` [ms]; it is not ranked."""
    worlds: Annotated[dict[str, WorldScore], BeforeValidator(by_world)]
    """Result in each world, by its name, with a score from 0 to 1; in the file as a table's
    columns."""
    slow: dict[Milliseconds, Share] = field(default_factory=dict[str, Share])
    """Share of worlds held, by the time that the tracker takes for a picture [ms]."""
    curve: Annotated[list[Share], Len(len(TAUS), len(TAUS))]
    """Share of the pictures of all worlds whose error is at most tau, for each tau in `TAUS`."""
    measures: dict[str, float | None] = field(default_factory=dict[str, float | None])
    """Further measures by name: medians over the worlds for a law, means for a tracker; None: no
    value."""

    def text(self) -> str:
        """Return these results as JSON, with a line for each key; "worlds" are the columns of a
        table, "world" and the fields of `WorldScore`.
        """
        columns = {"world": list(self.worlds)}
        for each in fields(WorldScore):
            columns[each.name] = [getattr(score, each.name) for score in self.worlds.values()]
        contents = self.contents() | {"worlds": columns}
        lines = (f'"{key}":{json_line(value)}' for key, value in contents.items())
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @property
    def rendering(self) -> str:
        """Digest, 12 hexadecimal digits, of the first pictures of the runs in all worlds of these
        results; "" if no pictures were rendered.
        """
        scores = sorted(self.worlds.items())
        seen = [f"{key} {score.picture}" for key, score in scores if score.picture]
        return hashlib.sha256("\n".join(seen).encode()).hexdigest()[:DIGITS] if seen else ""


def curve_of(errors: Sequence[Array]) -> list[float]:
    """Return the share, from 0 to 1 and rounded to four decimals, of the pictures of all runs whose
    error is at most tau, for 41 evenly spaced tau from 0 to 2 target sizes.

    Args:
        errors: Errors (frames,) [target sizes] of each run.
    """
    every = np.concatenate([np.asarray(each, float) for each in errors])
    return [round(float(np.mean(every <= tau)), 4) for tau in TAUS]


def row_of(
    benchmark: Benchmark,
    band: Band,
    contestant: Contestant,
    records: Sequence[Record],
    command: str,
) -> Row:
    """Return the published results of a contestant (one row of the benchmark's table).

    Args:
        benchmark: The benchmark.
        band: The set of worlds (random scenarios) in which the runs were made.
        contestant: The contestant.
        records: Records of all runs of the contestant; those of other contestants are ignored.
        command: The command line that made the runs, which is stored too.
    """
    own = [r for r in records if r.settings[CONTESTANT] == contestant.name]
    at_once = [r for r in own if r.settings[SLOW] == 0.0]
    errors = {(r.settings[WORLD], r.settings[SLOW]): r.series[ERROR] for r in own}
    return Row(
        command=command,
        versions=versions(),
        benchmark=benchmark.name,
        hash=benchmark.hash,
        band=band.name,
        value=band.value,
        contestant=contestant.name,
        division=contestant.division.name,
        settings=contestant.settings,
        resolved=benchmark.resolved(contestant.settings),
        digest=contestant.digest,
        machine=f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}",
        track_ms=round(float(np.median([r.measures[TRACK_MS] for r in at_once])), 3),
        worlds={r.settings[WORLD]: world_score(benchmark.score, r) for r in at_once},
        slow={} if contestant.division is Division.SCALE else slow_of(benchmark, errors),
        curve=curve_of([r.series[ERROR] for r in at_once]),
        measures=_open_loop(at_once) if benchmark.score == "held" else _measures(at_once),
    )


def slow_of(benchmark: Benchmark, errors: Mapping[tuple[str, float], Array]) -> dict[str, float]:
    """Return the share (0 to 1) of worlds (random scenarios) in which the tracker held the target
    (an error of at most 1 target size in at least 95 % of the pictures), by the time that it was
    made to take for a picture [ms], as a text such as "33" ("0": it was not slowed). The result is
    empty if the benchmark has no runs with slowed trackers.

    Args:
        benchmark: The benchmark; only worlds of the condition that its `slow` names count.
        errors: Errors (frames,) [target sizes] of each run, by name of the world and time of the
            tracker [ms].
    """
    if benchmark.slow is None:
        return {}
    condition = benchmark.slow.condition
    runs = grouped_by([at for at in errors if condition_of(at[0]) == condition], lambda at: at[1])
    return {
        f"{ms:g}": float(np.mean([score_errors(errors[at]).held for at in of]))
        for ms, of in sorted(runs.items())
    }


def _open_loop(records: Sequence[Record]) -> dict[str, float | None]:
    """Return the means of a tracker's measures over the runs in which it also got the pictures of a
    camera that it did not steer; an empty dictionary if there are no such runs.
    """
    watched = [r for r in records if OVERLAP in r.measures]
    return {
        name: round(float(np.mean([r.measures[name] for r in watched])), 4)
        for name in (OVERLAP, WITHIN)
        if watched
    }


def _measures(records: Sequence[Record]) -> dict[str, float | None]:
    """Return medians of a control law's measures over all worlds, None if half of the worlds have
    no value; and, as "near_pct", the share of worlds [%] in which the camera ended within 100 mm
    and 10 degrees of its goal, limits wider than those of the score.
    """
    found: dict[str, float | None] = {}
    for name in MEASURES:
        values = np.array([r.measures[name] for r in records])
        median = float(np.median(np.where(np.isnan(values), np.inf, values)))  # nan: never settled
        found[name] = round(median, 4) if np.isfinite(median) else None
    near = float(np.mean([is_within(r, NEAR_MM, NEAR_DEG) for r in records]))
    return found | {"near_pct": round(100 * near, 1)}


def shipped_rows(benchmark: Benchmark) -> list[Row]:
    """Return the published results that come with servobench for this version of a benchmark, one
    for each contestant; an empty list if no results come with it.
    """
    folder = resources.files("scenes") / FOLDER / "rows" / benchmark.name
    with resources.as_file(folder) as path:
        rows = rows_in(path.glob("*.json")) if path.is_dir() else []
    return [row for row in rows if row.hash == benchmark.hash]


def rows_in(paths: Iterable[Path]) -> list[Row]:
    """Return the contestants' results in some JSON files, one for each file, sorted by path.

    Raises:
        Mistake: A file cannot be read, or has no results of a contestant.
    """
    return [Row.read(path) for path in sorted(paths)]


def check_version(benchmark: Benchmark, row: Row) -> None:
    """Check that a contestant's published results are of this version of a benchmark.

    Raises:
        Mistake: `row` is of another benchmark, or of another version.
    """
    if (row.benchmark, row.hash) != (benchmark.name, benchmark.hash):
        raise Mistake(
            f"these results are of {row.benchmark} {row.hash}, but {benchmark.name} "
            f"{benchmark.hash} is installed: results of two versions cannot be compared: run "
            "the benchmark again"
        )


def file_name(contestant: str) -> str:
    """Return the name of the JSON file with the results of a contestant: the contestant's name,
    with "_" for all characters but letters, digits and "-_.", and ".json".
    """
    kept = "".join(c if c.isalnum() or c in "-_." else "_" for c in contestant)
    return f"{kept}.json"
