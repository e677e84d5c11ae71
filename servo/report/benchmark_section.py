"""The section about a public benchmark: its table, curves, conditions, factors and failures."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.bench.benchmark import Band, Benchmark, World, load
from servo.bench.contestant import Division
from servo.bench.row import TAUS, Row, rows_in, shipped_rows
from servo.bench.score import Difficulty, Standing, by_size, effects, standings
from servo.report.charts import INK, Curve, Scale, curves, heat
from servo.report.page import LIGHT, Block, Fact, Figure, PageImage, Section, again
from servo.report.words import Badge, Table, Tone, shown, spread
from servo.study.store import Store, StudyFile

ROWS = "rows"
"""Folder of the rows, in that of the results."""
MOST_SHEETS = 24
PARTS = ("small", "middle", "large")
"""Thirds of a condition's tasks by their size."""


def section(folder: Path, study: StudyFile) -> Section:
    """Return the section about the folder of a benchmark.

    Raises:
        Mistake: A file is missing or damaged.
    """
    benchmark = load(study.name)
    rows = rows_in((folder / ROWS).glob("*.json"))
    table = standings(rows) if rows else []
    if not table:
        return _unfinished(folder, study)
    of_band = rows[0]
    band = Band(of_band.band, of_band.value, of_band.digest)
    worlds = [w for w in benchmark.every_world(band) if w.key in of_band.worlds]
    blocks = [
        *blocks_of(benchmark, worlds, rows, table),
        *_failures(folder),
        again(study),
    ]
    facts = [
        Fact("benchmark", f"{benchmark.name} {of_band.hash}"),
        Fact("worlds", str(len(worlds)), of_band.band),
        Fact("pictures", "the frozen ones" if _is_frozen(benchmark, rows) else "see below"),
    ]
    verdict = Badge(f"first: {table[0].name}", Tone.PLAIN)
    return Section(
        "benchmark", folder.resolve().name, study.title, verdict, facts, blocks, str(folder)
    )


def _unfinished(folder: Path, study: StudyFile) -> Section:
    """Return the section about a benchmark in which no contestant has run in all worlds yet."""
    store = Store(folder)
    store.find()
    done = Counter(
        record.settings["contestant"]
        for batch in store.read(store.done, long=False)
        for record in batch.values()
    )
    rows = [[str(name), str(done[name])] for name in study.axes["contestant"]]
    progress = f"{len(store.done)} of {study.runs} runs"
    sentence = (
        f"This benchmark is not finished: {progress}. The command below goes on with it; there are "
        "scores once a contestant has run in all worlds."
    )
    table = Table(("contestant", "runs so far"), rows, range(1))
    blocks = [Block("So far", [sentence], tables=[table]), *_failures(folder), again(study)]
    verdict = Badge(progress, Tone.PLAIN)
    return Section(
        "benchmark", folder.resolve().name, study.title, verdict, [], blocks, str(folder)
    )


def blocks_of(
    benchmark: Benchmark, worlds: Sequence[World], rows: Sequence[Row], table: Sequence[Standing]
) -> list[Block]:
    """Return table, curves, conditions and factors of some rows."""
    figures = [_conditions(benchmark, table)]
    if benchmark.score == "held":
        figures.insert(0, _curves(rows, table))
    else:
        figures += _sizes(benchmark, worlds, table)
    return [
        Block(
            "Contestants",
            [difficulty_of(rows)],
            tables=[standings_table(benchmark, rows)],
            figures=figures,
        ),
        Block("What the worlds do", tables=[_effects(worlds, table)]),
    ]


def standings_table(benchmark: Benchmark, rows: Sequence[Row]) -> Table:
    """Return the table of some rows, the best first."""
    is_loop = benchmark.score == "held"
    head = ["contestant", "division", "score", "held" if is_loop else "arrived", "rank", "P"]
    head += ["slowest", "ms"] if is_loop else ["near", "s", "m", "out"]
    found = list[list[str]]()
    for standing in standings(rows):
        row = standing.row
        cells = [
            standing.name,
            row.division.lower(),
            spread(standing.score),
            f"{100 * standing.held.value:.0f} %",
            "-".join(map(str, sorted({standing.first, standing.last}))),
            f"{standing.beats_next:.2f}",
        ]
        if is_loop:
            cells += [shown(standing.slowest), shown(row.track_ms)]
        else:
            of = row.measures
            cells += [
                shown(of.get(name))
                for name in ("near_pct", "settle_s", "camera_path_m", "out_of_view_pct")
            ]
        found.append(cells)
    note = (
        "Score: 0 where the camera stands still, "
        + ("100 for the truth; " if is_loop else "100 where each world is reached; ")
        + "with its 95 % interval over worlds. Rank: as an interval (paired t, Holm over pairs)."
    )
    return Table(head, found, range(2), note)


def difficulty_of(rows: Sequence[Row]) -> str:
    """Return a sentence about worlds that do not tell contestants apart."""
    found = Difficulty.of(standings(rows))
    return (
        f"Of {found.worlds} worlds {found.nobody} were won by nobody and {found.everybody} by "
        "every contestant."
    )


def _curves(rows: Sequence[Row], table: Sequence[Standing]) -> Figure:
    """Return the curves of the scale, and of as many contestants in colour as there are colours."""
    shares = np.linspace(0, len(table) - 1, min(len(table), len(LIGHT)))
    ranked = [table[int(i)].row for i in shares]
    scale = [row for row in rows if row.division == Division.SCALE.name]
    others = [row for row in rows if row not in ranked and row not in scale]

    def curve(row: Row, colour: str = INK, *, dashed: bool = False, faint: bool = False) -> Curve:
        share = np.array(row.curve)
        return Curve(row.contestant, TAUS, share, colour=colour, dashed=dashed, faint=faint)

    drawn = [curve(row, faint=True) for row in others]
    drawn += [curve(row, dashed=True) for row in scale]
    drawn += [curve(row, colour) for row, colour in zip(ranked, LIGHT, strict=False)]
    note = f"Grey: the {len(others)} others. Named are contestants of all ranks." if others else ""
    x = Scale("distance from the goal [target sizes]")
    y = Scale("share", low=0.0, high=1.0)
    return curves("Share of the time within", x, y, drawn, note=note)


def _conditions(benchmark: Benchmark, table: Sequence[Standing]) -> Figure:
    names = [c.name for c in benchmark.conditions]
    upwards = table[::-1]
    values = np.array([[round(s.mean_in(name)) for name in names] for s in upwards])
    title = "Points by condition"
    note = (
        "In points of all worlds: where standing still costs less than elsewhere, there is less "
        "to win, and where it costs more, more than 100."
    )
    labels = [s.name for s in upwards]
    return heat(title, "", "", names, labels, values, limits=(0.0, 100.0), note=note)


def _sizes(
    benchmark: Benchmark, worlds: Sequence[World], table: Sequence[Standing]
) -> list[Figure]:
    found = list[Figure]()
    for part, name in enumerate(PARTS):
        values = np.array(
            [
                [100 * by_size(s.row, worlds, c.name)[part] for c in benchmark.conditions]
                for s in table[::-1]
            ]
        )
        names = [c.name for c in benchmark.conditions]
        title = f"Arrived, {name} tasks [%]"
        labels = [s.name for s in table[::-1]]
        if np.isfinite(values).any():  # a quick run has two tasks, and no middle one
            found.append(heat(title, "", "", names, labels, values, limits=(0.0, 100.0)))
    return found


def _effects(worlds: Sequence[World], table: Sequence[Standing]) -> Table:
    rows = [[e.factor, e.level, spread(e.points)] for e in effects(worlds, table)]
    note = "Points, mean of all contestants, with 95 % intervals over worlds."
    return Table(("factor", "level", "points"), rows, range(2), note)


def _failures(folder: Path) -> list[Block]:
    """Return the contact sheets of worlds that were not won."""
    store = Store(folder)
    store.find()
    pictures = list[PageImage]()
    for batch in store.read(store.done, long=True):
        for record in batch.values():
            if record.sheet is not None and len(pictures) < MOST_SHEETS:
                title = f"{record.settings['contestant']}, {record.settings['world']}"
                pictures.append(PageImage.of(title, record.sheet, title, sheet=True))
    return [Block("Failures", pictures=pictures)] if pictures else []


def _is_frozen(benchmark: Benchmark, rows: Sequence[Row]) -> bool:
    return all(row.rendering in ("", benchmark.rendering) for row in rows)


def published(name: str) -> Table:
    """Return the table of the shipped rows of a benchmark."""
    benchmark = load(name)
    return standings_table(benchmark, shipped_rows(benchmark))
