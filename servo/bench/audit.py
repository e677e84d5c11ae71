"""Audit of a contestant's published results (its row of the benchmark's table): they are compared
with the errors in all pictures of its runs, which are stored in a file beside them, and with new
runs.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from servo.bench.benchmark import FARTHEST, QUICK, Band, Benchmark, World
from servo.bench.contestant import Contestant, Division
from servo.bench.row import Row, curve_of, slow_of
from servo.bench.world_run import SLOW, WORLD
from servo.bench.world_score import ERROR, WorldScore, score_errors, world_score
from servo.mistake import Mistake
from servo.study.record_file import parquet
from servo.study.run import Record
from sim.types import Array
from tracking.files.json_text import as_json

ROUNDING = 1.5e-9
"""Largest difference of a world's score between processors by rounding; 3e-12 was measured, and
scores are stored with nine decimals."""
STEPS = 500
"""Steps of an error of one target size in a file of errors."""
HALF = (0.5 + 1e-6) / STEPS
"""Largest distance of an error from that in the file [target sizes]."""
MOST = round(FARTHEST * STEPS) + 1
"""Steps of each error beyond the farthest that a score regards."""
ERROR_STEPS = f"error_{STEPS}ths"
"""Name of the column with the errors."""
TENTH = 10
LEAST = 10
"""An audit repeats a tenth of the worlds, and ten at least."""
NAMED = 3
"""Most worlds that a sentence names."""

Errors = dict[tuple[str, float], Array]
"""Error in each picture (frames,) [target sizes], by world and time of the tracker [ms]."""


def errors_file(row: Path) -> Path:
    """Return the path of the Parquet file with the errors in all pictures: that of the JSON file of
    a contestant's results (`row`), with the suffix .parquet.
    """
    return row.with_suffix(".parquet")


def errors_parquet(records: Sequence[Record]) -> bytes:
    """Return the bytes of a Parquet file with a row for each run of a benchmark: name of its world
    (random scenario), time that a slowed tracker took for a picture [ms] (0: not slowed), and the
    list of the target's errors in all pictures (as `errors_of` returns them), in 500ths of the
    target's size. Errors above 2 sizes, which no score tells apart, are 1001.
    """
    columns = {
        WORLD: [r.settings[WORLD] for r in records],
        SLOW: [r.settings[SLOW] for r in records],
        ERROR_STEPS: [_steps(r.series[ERROR]) for r in records],
    }
    return parquet(
        pa.table(columns),
        compression="zstd",
        compression_level=19,
        use_dictionary=False,
        # Errors of successive pictures are alike: their differences need fewer bits.
        column_encoding={f"{ERROR_STEPS}.list.element": "DELTA_BINARY_PACKED"},
    )


def _steps(errors: Array) -> NDArray[np.int16]:
    """Return errors (frames,) [target sizes] as they are in a file of errors, in 500ths."""
    return np.minimum(np.round(np.asarray(errors, float) * STEPS), MOST).astype(np.int16)


def read_errors(path: Path) -> Errors:
    """Return the errors (frames,) [target sizes] of each run in a Parquet file of `errors_parquet`,
    by name of the world (random scenario) and time of the slowed tracker [ms] (0: not slowed).

    Raises:
        Mistake: The file cannot be read, or lacks a column of errors, worlds or times.
    """
    try:
        table = pq.read_table(path, columns=[WORLD, SLOW, ERROR_STEPS]).to_pydict()
        rows = zip(table[WORLD], table[SLOW], table[ERROR_STEPS], strict=True)
        return {(str(world), float(ms)): np.array(each, float) / STEPS for world, ms, each in rows}
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError, MemoryError) as error:
        raise Mistake(
            f"{path}: this is not the file of errors that `servobench benchmark --submit` writes, "
            "or it cannot be read: write it again"
        ) from error


def audit(
    benchmark: Benchmark, row: Row, one: Contestant, errors: Errors | None
) -> tuple[list[str], list[str]]:
    """Compare a contestant's published results with the benchmark and with the errors in all
    pictures of its runs.

    Args:
        benchmark: The benchmark, in the version of the results.
        row: The published results.
        one: The contestant, as this version of servobench finds it.
        errors: The errors of all runs, as `read_errors` returns them; None if they were not sent.

    Returns:
        Two lists of sentences. The first has the faults: contradictions of the results to the
        benchmark, to `errors` or, for a shipped contestant or sealed worlds, to the contestant's
        settings and files; a quick run; and missing errors. The second has remarks: what could not
        be compared, and, for a user's contestant in public worlds, that settings or files differ.
        For loop-v1 and servo-v1, a quick run and missing errors are remarks too.
    """
    worlds = expected_worlds(benchmark, row)
    other = {world.key for world in worlds} ^ row.worlds.keys()
    whole = len(benchmark.conditions) * benchmark.worlds
    differs = (row.settings, row.digest) != (as_json(one.settings), one.digest)
    settings = "the contestant's settings or files differ from those given here"
    # Sealed worlds are drawn from the contestant's code, so that nobody else's can have them.
    is_bound = one.division in (Division.HOME, Division.SCALE) or row.band == "sealed"
    right = one.division.name
    quick = f"the row is of a quick run: {len(worlds)} of {whole} worlds"
    # Rows of the first versions, whose hash does not cover the measures, were published so.
    is_early = bool(benchmark.pinned)
    faults = (
        (other, f"the row's worlds differ from those of its band: {_some(other)}"),
        (differs and is_bound, settings),
        (len(worlds) < whole and not is_early, quick),
        (
            errors is None and not is_early,
            "its Parquet file with the errors of each run is missing: `--submit` writes it "
            "beside the JSON file",
        ),
        (
            row.division != right,
            f"the row's division is {row.division.lower()}; it should be {right.lower()}",
        ),
    )
    remarks = (
        (len(worlds) < whole and is_early, quick),
        (differs and not is_bound, settings),
        (
            errors is None and is_early,
            "without its Parquet file, the row's curve and slower trackers are unchecked",
        ),
        (
            benchmark.score != "held",
            "the row's medians (time, camera path, corners out of view) are unchecked",
        ),
    )
    contradictions = [] if errors is None else _contradictions(benchmark, row, errors)
    found = [sentence for is_so, sentence in faults if is_so]
    return [*found, *contradictions], [sentence for is_so, sentence in remarks if is_so]


def expected_worlds(benchmark: Benchmark, row: Row) -> list[World]:
    """Return the worlds (random scenarios) of which a contestant's results should consist: all
    worlds of the set that the results name or, if there are no more results than in a run with
    --quick, the first two of each condition.

    Args:
        benchmark: The benchmark.
        row: The contestant's results.
    """
    band = Band(row.band, row.value, row.digest)
    quick = benchmark.every_world(band, QUICK)
    return quick if len(row.worlds) <= len(quick) else benchmark.every_world(band)


def sample(worlds: Sequence[World], rng: np.random.Generator) -> list[World]:
    """Draw the worlds (random scenarios) that an audit repeats: a tenth of the given ones, rounded
    up, but at least ten (all if there are fewer), in the given order.

    An audit draws them when it begins, so that the author of the results cannot know them.
    """
    count = min(len(worlds), max(LEAST, math.ceil(len(worlds) / TENTH)))
    return [worlds[i] for i in sorted(rng.choice(len(worlds), count, replace=False))]


def _contradictions(benchmark: Benchmark, row: Row, errors: Errors) -> Iterator[str]:
    """Yield a sentence for each contradiction between a contestant's results (its row) and the
    errors in its pictures.
    """
    at_once = {world: e for (world, ms), e in errors.items() if ms == 0.0}
    if other := at_once.keys() ^ row.worlds.keys():
        yield f"the Parquet file has other worlds than the row: {_some(other)}"
        return
    wrong = [w for w, e in at_once.items() if not _follows(row.worlds[w], e)]
    if benchmark.score == "held" and wrong:
        yield f"the Parquet file gives other scores than the row: {_some(wrong)}"
    least, most = (curve_of([e + half for e in at_once.values()]) for half in (HALF, -HALF))
    if not all(map(_between, least, row.curve, most)):
        yield "the Parquet file gives another curve than the row"
    least, most = (
        slow_of(benchmark, {at: e + half for at, e in errors.items()}) for half in (HALF, -HALF)
    )
    of_times = least.keys() == row.slow.keys()
    if row.slow and not (of_times and all(_between(least[t], row.slow[t], most[t]) for t in least)):
        yield "the Parquet file gives other shares held by slower trackers than the row"


def _follows(score: WorldScore, errors: Array) -> bool:
    """Return True if a score may follow from errors (frames,) that are rounded to 500ths."""
    least, most = (score_errors(errors + half) for half in (HALF, -HALF))
    is_area = least.area - ROUNDING <= score.area <= most.area + ROUNDING
    return is_area and _between(least.held, score.held, most.held)


def _between(least: float, value: float, most: float) -> bool:
    """Return True if a value is in an interval."""
    return least <= value <= most


def _is_close(now: WorldScore, before: WorldScore) -> bool:
    return abs(now.area - before.area) <= ROUNDING and now.held == before.held


def _some(keys: Sequence[str] | set[str]) -> str:
    """Return a text with the first few names of some worlds, and the number of the others."""
    first = sorted(keys)[:NAMED]
    return ", ".join(first) + (f" and {len(keys) - NAMED} more" if len(keys) > NAMED else "")


@dataclass(frozen=True, slots=True)
class WorldComparison:
    """Agreement of a new run of one world (random scenario) with a contestant's published results:
    equal but for rounding (`agrees`), or equal bit for bit (`exactly`).
    """

    world: str
    agrees: bool
    """True if errors, score and first picture are equal but for rounding."""
    exactly: bool
    """True if they are equal bit for bit."""


def compare_run(
    benchmark: Benchmark, row: Row, errors: Errors | None, record: Record
) -> WorldComparison:
    """Compare a new run in a world (random scenario) with a contestant's published results and with
    the errors in the pictures of its old run. A run with a slowed tracker is compared with the
    errors only.

    Args:
        benchmark: The benchmark.
        row: The published results.
        errors: The errors of all old runs, as `read_errors` returns them; None: unknown, so that a
            run with a slowed tracker counts as equal.
        record: The record of the new run.
    """
    world, ms = record.settings[WORLD], float(record.settings[SLOW])
    now = _steps(record.series[ERROR]) / STEPS
    exactly = agrees = True
    if errors is not None:
        before = errors.get((world, ms), now[:0])
        exactly = np.array_equal(now, before)
        # Rounding may turn one step into the next.
        agrees = exactly or (now.shape == before.shape and np.allclose(now, before, 0, 3 * HALF))
    if ms == 0.0:
        found = world_score(benchmark.score, record)
        published = row.worlds[world]
        if not published.last:  # an older row
            found = replace(found, last="")
        exactly = exactly and found == published
        agrees = agrees and _is_close(found, published) and found.picture == published.picture
    return WorldComparison(world, agrees, exactly)
