"""The audit of a benchmark's row: it is compared with its own errors and with new runs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.bench.benchmark import QUICK, Band, Benchmark, World
from servo.bench.contestant import Contestant, Division
from servo.bench.row import Row, Won, curve_of, slow_of, won, won_by
from servo.bench.world_run import ERROR, SLOW, WORLD
from servo.mistake import Mistake
from servo.study.record_file import parquet
from servo.study.run import Record
from sim.types import Array
from tracking.files.json_text import as_json

ROUNDING = 1e-9
"""Largest difference of an area between processors, by rounding; 3e-12 was measured."""
NEAR = 1e-4
"""The same for the error of one picture, which is kept with seven digits [target sizes]."""
TENTH = 10
LEAST = 10
"""An audit repeats a tenth of the worlds, and ten at least."""
NAMED = 3
"""Most worlds that a sentence names."""

Errors = dict[tuple[str, float], Array]
"""Error in each picture (frames,) [target sizes], by world and time of the tracker [ms]."""


def errors_file(row: Path) -> Path:
    """Return the path of the errors of a row: a Parquet file beside the row's file."""
    return row.with_suffix(".parquet")


def errors_text(records: Sequence[Record]) -> bytes:
    """Return the errors of a contestant's runs as a Parquet file."""
    table = pa.table(
        {
            WORLD: [r.settings[WORLD] for r in records],
            SLOW: [r.settings[SLOW] for r in records],
            ERROR: [np.asarray(r.series[ERROR], np.float32) for r in records],
        }
    )
    return parquet(table)


def read_errors(path: Path) -> Errors:
    """Return the errors in a Parquet file.

    Raises:
        Mistake: The file cannot be read, or is not one of a row's errors.
    """
    try:
        table = pq.read_table(path, columns=[WORLD, SLOW, ERROR]).to_pydict()
        rows = zip(table[WORLD], table[SLOW], table[ERROR], strict=True)
        return {(str(world), float(ms)): np.array(each, float) for world, ms, each in rows}
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError, MemoryError) as error:
        raise Mistake(f"{path}: this is no file of a row's errors") from error


@dataclass(frozen=True, slots=True)
class Audit:
    """The result of an audit before worlds are run again."""

    worlds: Sequence[World]
    """The worlds that the row should have."""
    faults: Sequence[str]
    """A sentence for each contradiction of the row to the benchmark or to itself."""
    remarks: Sequence[str]
    """A sentence for each part of the row that could not be compared."""


def audit(benchmark: Benchmark, row: Row, one: Contestant, errors: Errors | None) -> Audit:
    """Compare a row with its benchmark and with the errors of its pictures.

    Args:
        benchmark: Of the same version.
        row: The row that was sent.
        one: Its contestant, in this version of servobench.
        errors: Of all its runs, if they were sent.
    """
    worlds = expected_worlds(benchmark, row)
    faults = list[str]()
    remarks = list[str]()
    keys = {world.key for world in worlds}
    if keys != row.worlds.keys():
        faults.append(f"its worlds are not those of the band: {_some(keys ^ row.worlds.keys())}")
    whole = len(benchmark.conditions) * benchmark.worlds
    if len(worlds) < whole:
        remarks.append(f"it is of a quick run: {len(worlds)} of {whole} worlds")
    if (row.settings, row.digest) != (as_json(one.settings), one.digest):
        told = faults if one.division in (Division.HOME, Division.SCALE) else remarks
        told.append("the settings or files of its contestant are others than those given here")
    if row.division != one.division.name:
        faults.append(f"its division is {row.division.lower()}, and is {one.division.name.lower()}")
    if errors is None:
        remarks.append("without its Parquet file, its curve and slower trackers are not compared")
    else:
        faults += _contradictions(benchmark, row, errors)
    if benchmark.score == "arrives":
        remarks.append("its medians (time, camera path, corners out of view) are not compared")
    return Audit(worlds, faults, remarks)


def expected_worlds(benchmark: Benchmark, row: Row) -> list[World]:
    """Return the worlds that a row should have: all of its band, or those of --quick."""
    band = band_of(row)
    quick = benchmark.every_world(band, QUICK)
    return quick if len(row.worlds) <= len(quick) else benchmark.every_world(band)


def band_of(row: Row) -> Band:
    """Return the band of a row's worlds."""
    return Band(row.band, row.value, row.digest) if row.band == "sealed" else Band(row.band)


def sample(worlds: Sequence[World], rng: np.random.Generator) -> list[World]:
    """Return the worlds that an audit repeats.

    They are drawn when the audit begins, so that the author of a row cannot know them.
    """
    count = min(len(worlds), max(LEAST, math.ceil(len(worlds) / TENTH)))
    return [worlds[i] for i in sorted(rng.choice(len(worlds), count, replace=False))]


def _contradictions(benchmark: Benchmark, row: Row, errors: Errors) -> list[str]:
    """Return a sentence for each contradiction of a row to its errors."""
    at_once = {world: e for (world, ms), e in errors.items() if ms == 0.0}
    faults = list[str]()
    if at_once.keys() != row.worlds.keys():
        other = at_once.keys() ^ row.worlds.keys()
        return [f"its Parquet file has other worlds: {_some(other)}"]
    if benchmark.score == "held":
        wrong = [w for w, e in at_once.items() if not _is_close(won_by(e), row.worlds[w])]
        if wrong:
            faults.append(f"its Parquet file gives other areas: {_some(wrong)}")
    if curve_of(list(at_once.values())) != row.curve:
        faults.append("its Parquet file gives another curve")
    slow = slow_of(benchmark, errors) if row.slow else {}
    if slow != row.slow:
        faults.append("its Parquet file gives other shares held by slower trackers")
    return faults


def _is_close(now: Won, before: Won) -> bool:
    return abs(now.area - before.area) <= ROUNDING and now.held == before.held


def _some(keys: Sequence[str] | set[str]) -> str:
    """Return the first ones of some worlds' names."""
    first = sorted(keys)[:NAMED]
    return ", ".join(first) + (f" and {len(keys) - NAMED} more" if len(keys) > NAMED else "")


@dataclass(frozen=True, slots=True)
class Repeated:
    """The comparison of a new run of a world with its row."""

    world: str
    agrees: bool
    exactly: bool
    """Whether it agrees bit for bit."""


def repeated(benchmark: Benchmark, row: Row, errors: Errors | None, record: Record) -> Repeated:
    """Compare a new run of a world with its row and with the errors beside the row."""
    world, ms = record.settings[WORLD], float(record.settings[SLOW])
    now = np.asarray(record.series[ERROR], np.float32).astype(float)
    exactly = agrees = True
    if errors is not None:
        before = errors.get((world, ms), now[:0])
        exactly = np.array_equal(now, before)
        agrees = exactly or (now.shape == before.shape and np.allclose(now, before, 0, NEAR))
    if ms == 0.0:
        found, told = won(benchmark, record), row.worlds[world]
        if not told.last:  # an older row
            found = replace(found, last="")
        exactly = exactly and found == told
        agrees = agrees and _is_close(found, told) and found.picture == told.picture
    return Repeated(world, agrees, exactly)
