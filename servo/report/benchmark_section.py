"""The section of an HTML report about a public benchmark: table of contestants, curves, conditions,
factors, failures.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from servo.bench.benchmark import Band, Benchmark, World, load
from servo.bench.contestant import FROZEN, Division
from servo.bench.row import TAUS, Row, rows_in, shipped_rows
from servo.bench.score import (
    ONE_SCALE,
    Difficulty,
    Discrimination,
    Standing,
    by_size,
    effects,
    standings,
)
from servo.bench.world_run import OVERLAP, WITHIN
from servo.mistake import Mistake
from servo.report.charts import Curve, Scale, curves, heat
from servo.report.page import LIGHT, Block, Fact, Figure, PageImage, Section, again
from servo.report.words import Badge, Table, Tone, shown, spread
from servo.study.store import Store, StudyFile
from sim.types import Array

ROWS = "rows"
"""Folder of the rows, in that of the results."""
MOST_SHEETS = 24
MANY = 100_000
"""Largest number of needed worlds that is stated: nobody runs more."""
PARTS = 6
"""Number of groups into which the worlds of a condition are split by the size of their task: with
30 to 42 worlds, five to seven in each."""
COLUMNS = {
    "near": "near_pct",
    "mm": "end_position_mm",
    "deg": "end_rotation_deg",
    "s": "settle_s",
    "m": "camera_path_m",
    "turned deg": "camera_turn_deg",
    "back m": "retreat_m",
    "out": "out_of_view_pct",
    "farthest px": "excursion_px",
    "IoU alone": OVERLAP,
    "near alone": WITHIN,
}
"""Columns of the table: measures of a law's or a tracker's row. Older rows do not have all."""
LAW_COLUMNS = (
    "Near: worlds that end within 10 cm and 10 deg [%]. Medians over worlds: error that remains "
    "[mm, deg], time [s], path [m], turns [deg] and retreat [m] of the camera, time with corners "
    "out of view [%], a corner's largest distance from the middle of the picture [px]; a dash "
    "where half of the worlds never settle, or where an older row has no value."
)
HELD = {
    "centre": "Held: worlds in which the target is within its own size of the goal for 95 % of the "
    "time. ",
    "size": "Held: worlds in which the target is within its own size of the goal, and the depth "
    "within a fifth, for 95 % of the time. ",
    "all": "Held: worlds in which the target is within its own size of the goal, the depth within "
    "a fifth and the angle within 15 degrees, for 95 % of the time. ",
}
"""What it means that a tracker holds the target, by what a benchmark's error covers."""
ALONE = (
    "Alone: while a camera that follows the truth takes the pictures, the tracker's mean overlap "
    "with the target (intersection over union), and the pictures in which its centre is at most "
    "half a target size from the true one [%]. "
)
SLOWEST = (
    "Slowest: longest computing time with which half of the worlds of reversal are held [ms]; a "
    f"dash where no more worlds are held than by {FROZEN}. "
)


def section(folder: Path, study: StudyFile) -> Section:
    """Return the section of an HTML report about a folder that `servobench benchmark` wrote. While
    no contestant (tracker or control law) has run in all worlds (drawn scenarios), it lists the
    runs so far.

    Args:
        folder: The folder.
        study: Content of its study.json.

    Raises:
        Mistake: A file is missing or damaged, there is no benchmark of this name, or the results of
            the reference "still" are missing.
        Refused: The database of the runs cannot be read.
    """
    benchmark = load(study.name)
    rows = rows_in((folder / ROWS).glob("*.json"))
    table = standings(rows) if rows else []
    if not table:
        return _unfinished(folder, study)
    blocks = [*_failures(folder), again(study)]
    return _section(benchmark, beside_published(benchmark, rows), folder, blocks)


def published_section(name: str) -> Section:
    """Return the section of an HTML report about the published results of a benchmark, which are
    shipped.

    Args:
        name: Name of the benchmark, such as "loop-v1".

    Raises:
        Mistake: There is no benchmark of this name, or it has no published results yet.
    """
    benchmark = load(name)
    rows = shipped_rows(benchmark)
    if not rows:
        raise Mistake(
            f"{name} has no published results yet: run `servobench benchmark {name}`, and give "
            "the folder that it writes"
        )
    found = _section(benchmark, rows, Path(name), [])
    return replace(found, kind="published results", folder="")


def _section(
    benchmark: Benchmark, rows: Sequence[Row], folder: Path, blocks: Sequence[Block]
) -> Section:
    first = rows[0]
    band = Band(first.band, first.value, first.digest)
    worlds = [w for w in benchmark.every_world(band) if w.key in first.worlds]
    groups = by_pictures(benchmark, rows)
    facts = [
        Fact("benchmark", f"{benchmark.name} {first.hash}"),
        Fact("worlds", str(len(worlds)), first.band),
    ]
    if is_whole(benchmark, rows) and benchmark.rendering:
        ours = list(groups) == [benchmark.rendering]
        facts.append(Fact("pictures", "the frozen ones" if ours else "others, see the tables"))
    verdict = Badge(f"first: {standings(next(iter(groups.values())))[0].name}", Tone.PLAIN)
    every = [*blocks_of(benchmark, worlds, groups), *blocks]
    title = folder.resolve().name
    return Section("benchmark", title, benchmark.title, verdict, facts, every, str(folder))


def is_whole(benchmark: Benchmark, rows: Sequence[Row]) -> bool:
    """Return True if all rows (each the results of a contestant) are complete: they have every
    world (drawn scenario) of the published table, the set of worlds called "v1".
    """
    whole = len(benchmark.conditions) * benchmark.worlds
    return all(row.band == "v1" and len(row.worlds) == whole for row in rows)


def beside_published(benchmark: Benchmark, rows: Sequence[Row]) -> list[Row]:
    """Return the given rows (each the results of a contestant), followed by the shipped rows of all
    other contestants. These are added only if every given row has all worlds (drawn scenarios) of
    the published table.
    """
    names = {row.contestant for row in rows}
    whole = is_whole(benchmark, rows)
    shipped = [row for row in shipped_rows(benchmark) if whole and row.contestant not in names]
    return [*rows, *shipped]


def by_pictures(benchmark: Benchmark, rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return rows (each the results of a contestant) in groups, by the digest of their rendered
    pictures: only results on the same pictures can be compared.

    If there are rows with the benchmark's own (frozen) pictures, their group is first. Rows without
    pictures, such as those of "still" and "truth" in a benchmark of trackers, whose results define
    the scores 0 and 100, are in each group. If no row has pictures, there is one group, "".
    """
    seen = {row.rendering for row in rows} - {""} or {""}
    order = sorted(seen, key=lambda one: (one != benchmark.rendering, one))
    return {one: [row for row in rows if row.rendering in ("", one)] for one in order}


def by_division(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return rows (each the results of a contestant) in tables, by the words that are added to a
    table's title. Without rows of the division OPEN (whose settings may differ from the file's),
    all rows are in one table, "". Otherwise ", open division" has the rows of OPEN, those of
    shipped contestants and the references of the scale; and "" has all rows but those of OPEN, if
    these are more than references.
    """
    of_open = [row for row in rows if row.division == Division.OPEN.name]
    if not of_open:
        return {"": [*rows]}
    others = [row for row in rows if row not in of_open]
    beside = [row for row in others if row.division != Division.CLOSED.name]
    found = {", open division": [*of_open, *beside]}
    is_more = any(row.division != Division.SCALE.name for row in others)
    return {"": others, **found} if is_more else found


def _unfinished(folder: Path, study: StudyFile) -> Section:
    """Return the section of an HTML report about a benchmark in which no contestant has run in all
    worlds yet.
    """
    store = Store(folder)
    store.find()
    done = Counter(record.settings["contestant"] for record in store.read(store.done))
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
    benchmark: Benchmark, worlds: Sequence[World], groups: Mapping[str, Sequence[Row]]
) -> list[Block]:
    """Return the blocks of a report, two for each table (`by_division`) of each group of rows (each
    the results of a contestant): one with the contestants' table and figures, one with the effects
    of the factors in which worlds (drawn scenarios) differ.

    Args:
        benchmark: The benchmark.
        worlds: The worlds in which all of the contestants ran.
        groups: Rows by the digest of their pictures, from `by_pictures`.
    """
    found = list[Block]()
    tables = [
        (rendering, division, rows)
        for rendering, group in groups.items()
        for division, rows in by_division(group).items()
    ]
    for rendering, division, rows in tables:
        other = len(groups) > 1 and rendering != benchmark.rendering
        after = (f", pictures {rendering}" if other else "") + division
        table = standings(rows)
        is_loop = benchmark.score == "held"
        first = _curves(rows, table) if is_loop else _sizes(benchmark, worlds, table)
        figures = [first, _conditions(benchmark, table)]
        text = list(filter(None, [difficulty_of(rows), discrimination_of(rows)]))
        shown = [standings_table(benchmark, rows)]
        found += [
            Block(f"Contestants{after}", text, tables=shown, figures=figures),
            Block(f"Points by property of the world{after}", tables=[_effects(worlds, table)]),
        ]
    return found


def standings_table(benchmark: Benchmark, rows: Sequence[Row]) -> Table:
    """Return the table of a benchmark's contestants (score, rank, measures), the best score first.

    Args:
        benchmark: The benchmark, which decides which measures are shown.
        rows: The results of each contestant.
    """
    is_loop = benchmark.score == "held"
    head = ("contestant", "division", "score", "held" if is_loop else "arrived", "rank", "P")
    columns = _columns(rows)
    late = ["slowest"] if benchmark.slow else []
    table = standings(rows)
    found = [
        [
            standing.name,
            standing.row.division.lower(),
            spread(standing.score),
            f"{100 * standing.held.value:.0f} %",
            "-".join(map(str, sorted({standing.first, standing.last}))),
            shown(None) if standing.beats_next is None else f"{standing.beats_next:.2f}",
            *map(shown, [standing.slowest for _ in late]),
            *map(shown, _measures(standing.row, columns)),
        ]
        for standing in table
    ]
    note = (
        "Score: 0 where the camera stands still, "
        + ("100 for the truth; " if is_loop else "100 where each world is reached; ")
        + "with its 95 % interval over worlds. Rank: as an interval (paired t, Holm over pairs). "
        + "P: probability to be better than the next one in the same world. "
        + (HELD[benchmark.error] if is_loop else LAW_COLUMNS)
        + (SLOWEST if late else "")
        + (ALONE if is_loop and columns else "")
    ).rstrip()
    home = [i for i, standing in enumerate(table) if is_home(standing.row)]
    return Table(
        [*head, *late, *columns], found, range(2), note, home if len(home) < len(table) else ()
    )


def _columns(rows: Sequence[Row]) -> list[str]:
    """Return the names of the columns with measures that at least one row has."""
    return [name for name, key in COLUMNS.items() if any(key in row.measures for row in rows)]


def _measures(row: Row, columns: Sequence[str]) -> list[float | None]:
    """Return the measures of a row in the given columns; None: the row has none."""
    return [row.measures.get(COLUMNS[name]) for name in columns]


def is_home(row: Row) -> bool:
    """Return True if a contestant's row of results is in the division HOME: that of trackers and
    laws as servobench ships them, with unchanged settings. Tables draw such rows in grey if there
    are others.
    """
    return row.division == Division.HOME.name


def discrimination_of(rows: Sequence[Row]) -> str:
    """Return sentences that say how well the worlds (drawn scenarios) tell the contestants apart;
    "" for fewer than three contestants, or if all have the same points everywhere. The reference
    tracker `frozen` does not count.

    Args:
        rows: The results of each contestant.
    """
    found = Discrimination.of(standings(rows))
    if found is None:
        return ""
    needed = f"{found.needed:,.0f}" if found.needed < MANY else f"More than {MANY:,}"
    return (
        f"{100 * found.agreeing:.0f} % of the worlds in which contestants differ agree with the "
        "others on who is better (item-rest correlation above 0.2); two random halves of the "
        f"worlds rank them alike (split-half reliability {found.halves:.3f}). {needed} worlds "
        "are needed to tell the first two apart with a power of 80 %."
    )


def difficulty_of(rows: Sequence[Row]) -> str:
    """Return a sentence with the numbers of worlds (drawn scenarios) in which nobody and in which
    every contestant succeeded; "" for fewer than three contestants. The reference tracker `frozen`
    does not count.

    Args:
        rows: The results of each contestant.
    """
    found = Difficulty.of(standings(rows))
    if found is None:
        return ""
    return (
        f"Of {found.worlds} worlds {found.nobody} were won by nobody and {found.everybody} by "
        "every contestant"
        + (f" but {FROZEN}." if any(row.contestant == FROZEN for row in rows) else ".")
    )


def _curves(rows: Sequence[Row], table: Sequence[Standing]) -> Figure:
    """Return the figure of the share of time within a distance of the goal, over this distance:
    some contestants named in colour, the references that fix the scale dashed, all others grey.
    """
    drawn, note = _drawn(table, TAUS, lambda row: np.array(row.curve))
    scale = [row for row in rows if row.division == Division.SCALE.name]
    drawn += [Curve(row.contestant, TAUS, np.array(row.curve), dashed=True) for row in scale]
    x = Scale("distance from the goal [target sizes]")
    y = Scale("share", low=0.0, high=1.0)
    return curves("Share of the time within", x, y, drawn, note=note)


def _drawn(
    table: Sequence[Standing], x: Array, y: Callable[[Row], Array]
) -> tuple[list[Curve], str]:
    """Return the curve y(row) over x (n,) of each contestant, and a note if some are grey.

    Guests are named and coloured, as many as there are colours, and with the colours that are left
    shipped contestants from all ranks. All others are grey.
    """
    guests = [s.row for s in table if not is_home(s.row)]
    shipped = [s.row for s in table if is_home(s.row)]
    named = _spread(guests, len(LIGHT))
    named += _spread(shipped, len(LIGHT) - len(named))
    others = [s.row for s in table if s.row not in named]
    drawn = [Curve(row.contestant, x, y(row), faint=True) for row in others]
    drawn += [
        Curve(row.contestant, x, y(row), colour=ink) for row, ink in zip(named, LIGHT, strict=False)
    ]
    return drawn, "Grey: all others." * bool(others)


def _spread(rows: Sequence[Row], most: int) -> list[Row]:
    """Return at most `most` of the rows, evenly spaced from the first to the last."""
    return [rows[int(i)] for i in np.linspace(0, len(rows) - 1, min(len(rows), most))]


def _conditions(benchmark: Benchmark, table: Sequence[Standing]) -> Figure:
    names = [c.name for c in benchmark.conditions]
    upwards = table[::-1]
    values = np.round([[s.mean_in(name) for name in names] for s in upwards])
    title = "Points by condition"
    one_scale = (
        "In points of all worlds: where standing still costs less than elsewhere, there is less "
        "to win, and where it costs more, more than 100."
    )
    note = one_scale if benchmark.name in ONE_SCALE else ""
    labels = [s.name for s in upwards]
    return heat(title, "", "", names, labels, values, limits=(0.0, 100.0), note=note)


def _sizes(benchmark: Benchmark, worlds: Sequence[World], table: Sequence[Standing]) -> Figure:
    """Return the figure of the share of worlds in which the goal was reached, over the size of the
    task (its rank in its condition, 0..1), as means over all conditions.
    """
    parts = min(PARTS, sum(w.condition == worlds[0].condition for w in worlds))

    def shares(row: Row) -> Array:
        of = [by_size(row, worlds, c.name, parts) for c in benchmark.conditions]
        return np.mean(of, axis=0)

    drawn, grey = _drawn(table, (np.arange(parts) + 0.5) / parts, shares)
    note = f"Mean of all conditions; each is cut into {parts} parts by the size of its task. {grey}"
    size = Scale("size of the task, as a rank in its condition", low=0.0, high=1.0)
    y = Scale("share of the worlds reached", low=0.0, high=1.02)
    return curves("Reached, by the size of the task", size, y, drawn, note=note.strip())


def _effects(worlds: Sequence[World], table: Sequence[Standing]) -> Table:
    rows = [[e.factor, e.level, spread(e.points)] for e in effects(worlds, table)]
    note = "Points, mean of all contestants, with 95 % intervals over worlds."
    return Table(("factor", "level", "points"), rows, range(2), note)


def _failures(folder: Path) -> list[Block]:
    """Return a list of one block of the report, which has up to 24 contact sheets of runs in which
    a contestant failed; an empty list if no run has a sheet.
    """
    store = Store(folder)
    store.find()
    pictures = list[PageImage]()
    for record in store.read(sorted(store.done), long=True):
        if record.sheet is not None and len(pictures) < MOST_SHEETS:
            title = f"{record.settings['contestant']}, {record.settings['world']}"
            pictures.append(PageImage.of(title, record.sheet, title, sheet=True))
    return [Block("Failures", pictures=pictures)] if pictures else []
