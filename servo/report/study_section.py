"""The section of an HTML report about a study: bounds, comparisons, curves over time and over the
axes, contact sheets of pictures, tables, and the runs that failed.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from servo.loop.measure import MEASURES
from servo.loop.run_measures import Outcome
from servo.loop.settings import DOES_NOT_REPEAT
from servo.report import page, study_paths, study_time
from servo.report.page import Block, Fact, Figure, PageImage, Section
from servo.report.study_data import SUCCESS, RunRow, StudyResults, load, median, missing, values
from servo.report.words import (
    NOTHING,
    Badge,
    Cell,
    Table,
    Tone,
    basis,
    counted,
    cut,
    listed,
    shown,
    spread,
)
from servo.study.bounds import missed_by_cells
from servo.study.results import COMPARED, Compared, comparisons, grouped, uncounted
from servo.study.store import FAILURES

MOST_SHEETS = 24
MOST_FAILURES = 12
MOST_LISTED = 12
"""Most contact sheets, failures and items of other lists on a page, which should open at once."""
TIME = "track_ms"
COLUMNS = ("servo_rms_px", "servo_peak_px", "tracking_rms_px", "settle_s", "lost_pct", TIME)
PATHS = ("settle_s", "camera_path_m", "detour_m", "retreat_m", "out_of_view_pct", "lost_pct")
"""Measures in the tables of most studies (`COLUMNS`), and of those whose section shows paths; the
files have all measures."""
PATHS_TITLE = "Paths of the camera and of the corners"
PATHS_TEXT = (
    "Runs of the first seed. Above: the path of the camera around the target [m], of all runs in a "
    "box of the same size, or in a larger one where a path leaves it. Below: the paths of the "
    "corners in the picture [px]. A ring is a start, a dot is an end."
)
SURE = 0.05
"""A smaller p-value, after Holm's correction, counts as a difference between two values."""
UNITS = (
    "Intervals are over independent units: scenarios if there are several, else random draws or "
    "seeds. Seeds under which the scenario is not varied count as one run."
)
BOUNDS = (
    "Bounds are on means over the runs of a cell (one value of each axis); a median on this page "
    "can be on the other side of a bound."
)


def section(folder: Path, measures: Sequence[str] | None = None) -> Section:
    """Return the section of an HTML report about a study: a folder that `servobench sweep` or
    `compare` wrote.

    Args:
        folder: The folder.
        measures: Names of the measures in its tables; None: a few that suit the compared axis.

    Raises:
        Mistake: A file is missing or damaged.
        Refused: The study's database cannot be read.
    """
    study = load(folder)
    plan = study.plan
    broken = missed_by_cells(grouped(list(study.axes), study.rows), plan.expect)
    blocks = [_overview(study, broken)]
    if study.rows:
        columns = measures or (PATHS if study_paths.shows(study) else COLUMNS)
        blocks = [
            *_figures("Over time", study_time.figures(study)),
            _compared(study, columns),
            *blocks,
            *_figures("Against the axes", study_time.against(study)),
            *_figures("Over two axes", study_time.heat_maps(study)),
            *_figures(PATHS_TITLE, study_paths.paths(study), PATHS_TEXT),
            *_sheets(study),
            _cells(study, columns),
            _runs(study),
        ]
    blocks += [*_failures(study), page.again(plan)]
    verdict = _verdict(study, broken)
    facts = _facts(study, broken)
    return Section("study", plan.name, plan.title, verdict, facts, blocks, str(folder))


def _verdict(study: StudyResults, broken: Sequence[str]) -> Badge:
    done = len(study.rows)
    runs = study.plan.runs
    if done < runs:
        return Badge(f"{done} of {runs} runs", Tone.BAD if study.failures else Tone.PLAIN)
    if study.plan.expect:
        return Badge.of(not broken, "bounds kept", "bounds missed")
    return Badge(f"{runs} runs", Tone.PLAIN)


def _facts(study: StudyResults, broken: Sequence[str]) -> list[Fact]:
    plan = study.plan
    rows = study.rows
    facts = [Fact("runs", f"{len(rows)} of {plan.runs}", f"{len(plan.seeds)} seeds a cell")]
    if rows:
        units = study.units(rows)
        rate = units.mean(SUCCESS)
        if rate is not None:
            facts.append(Fact("success rate", shown(rate.value), basis(rate, units.name)))
        for name in ("servo_rms_px", "tracking_rms_px"):
            measure = MEASURES[name]
            value = f"{shown(median(rows, name))} {measure.unit}"
            facts.append(Fact(f"{measure.meaning}, median", value, name))
    if plan.expect and rows:
        facts.append(Fact("bounds", Badge.of(not broken, "all kept", f"{len(broken)} missed")))
    if study.failures:
        facts.append(Fact("runs that failed", Badge(str(len(study.failures)), Tone.BAD)))
    return facts


def _overview(study: StudyResults, broken: Sequence[str]) -> Block:
    plan = study.plan
    text = missing(plan, study.store)
    if not all(row.get("repeats", True) for row in study.rows):
        text.append(f"{DOES_NOT_REPEAT}.")
    text += _unsure(study)
    rows = [["axis", key, ", ".join(map(shown, values))] for key, values in plan.axes.items()]
    for key, laws in plan.draws.items():
        described = (f"{law} {', '.join(map(shown, numbers))}" for law, numbers in laws.items())
        rows.append(["drawn for each seed", key, "; ".join(described)])
    rows += [
        ["bound", name, f"at {'least' if name == 'success_rate' else 'most'} {bound:g}"]
        for name, bound in plan.expect.items()
    ]
    rows.append(
        [
            "seeds",
            "",
            ", ".join(map(str, plan.seeds[:MOST_LISTED]))
            + (" ..." if len(plan.seeds) > MOST_LISTED else ""),
        ]
    )
    if plan.expect and study.rows:
        text += [] if broken else ["Every cell keeps every bound."]
        text.append(BOUNDS)
    text += filter(None, [cut("missed bounds", broken, MOST_LISTED)])
    table = Table(("what", "setting", "values"), rows, words=range(3))
    return Block("What was varied, and what held", text, broken[:MOST_LISTED], [table])


def _median_words(rows: list[RunRow], name: str) -> str:
    """Return the median of a measure as text; if not all runs have the measure, with their number:
    "1.2 (3 of 5)".
    """
    found = len(values(rows, name))
    return shown(median(rows, name)) + f" ({found} of {len(rows)})" * (0 < found < len(rows))


def _compared(study: StudyResults, columns: Sequence[str]) -> Block:
    groups = study.groups(study.compared)
    outcomes = [o for o in Outcome.__members__ if any(r["outcome"] == o for r in study.rows)]
    rows: list[list[Cell]] = []
    planned = study.plan.runs // len(groups)
    for name, group in groups.items():
        ended = [sum(r["outcome"] == o for r in group) for o in outcomes]
        medians = [_median_words(group, m) for m in columns]
        units = study.units(group)
        rate = units.mean(SUCCESS)
        over = counted(rate, units.name)
        runs = f"{len(group)}" + f" of {planned}" * (len(group) != planned)
        rows.append([name, runs, over, spread(rate), *map(str, ended), *medians])
    head = (
        study.compared or "runs",
        "runs",
        "units",
        "success (95 %)",
        *outcomes,
        *columns,
    )
    note = (
        f"{UNITS} A run is a success if it ends with the outcome that its scenario expects "
        "(expect.outcome), so that one of another outcome than CONVERGED can be a success, and a "
        "converged one none. Outcomes are counts of runs, measures are medians over runs; '(2 of "
        "9)': over those that have the measure, as settle_s over the runs that settled. Runs that "
        "failed, or are not finished ('6 of 10'), are in no share, median or comparison."
    )
    tables = [Table(head, rows[: page.MOST_ROWS], note=note)]
    compared = study.plan.compare if study.plan.compare in study.axes else None
    pairs = comparisons(compared, list(study.axes), study.rows, drawn=bool(study.plan.draws))
    if pairs:
        cells = [list(map(shown, pair.cells)) for pair in pairs[: page.MOST_ROWS]]
        described = (
            "McNemar's test on success: in how many units the first succeeds more often than the "
            "second in runs that are otherwise the same; p_holm is corrected for their number."
        )
        tables.append(Table(COMPARED, cells, words=range(3), note=described))
    return Block("Compared", points=_sure(pairs), tables=tables)


def _unsure(study: StudyResults) -> list[str]:
    """Return sentences about values that are missing, and about runs that failed and finished when
    they were tried again.
    """
    found = list[str]()
    if short := uncounted(study.rows):
        found.append(short)
    if study.retried:
        runs = ", ".join(str(failure.run) for failure in study.retried[:MOST_LISTED])
        found.append(
            "Runs that failed first and finished when they were tried again, so that something in "
            f"them does not repeat itself: {len(study.retried)} ({runs}). Their errors are in "
            f"{FAILURES}/."
        )
    return found


def _sure(pairs: Sequence[Compared]) -> list[str]:
    found = [c for c in pairs if c.p_holm < SURE and c.test.wins > c.test.losses]
    return [
        f"{c.first} succeeds more often than {c.second}: in {c.test.wins} {c.unit}s against "
        f"{c.test.losses} (p = {c.p_holm:.2g} after Holm)."
        for c in found[:MOST_LISTED]
    ]


def _figures(title: str, figures: list[Figure], *text: str) -> list[Block]:
    return [Block(title, text, figures=figures)] if figures else []


def _sheets(study: StudyResults) -> list[Block]:
    found = [
        PageImage.of(
            f"{_named(study, row)}: {row['outcome']}",
            encoded,
            f"{study.store.folder}: the sheet of run {row['run']}",
            sheet=True,
        )
        for row, encoded in study.sheets(MOST_SHEETS)
    ]
    if not found:
        return []
    text = ["Truth white, estimate green; runs that did not succeed first."]
    if len(found) == MOST_SHEETS:
        text.append(f"At most {MOST_SHEETS} are shown.")
    return [Block("Contact sheets", text, pictures=found)]


def _named(study: StudyResults, row: RunRow) -> str:
    settings = {key: row[key] for key in study.axes}
    return f"run {row['run']}, {listed(settings | {'seed': row.get('seed')})}"


def _cells(study: StudyResults, columns: Sequence[str]) -> Block:
    found = grouped(list(study.axes), study.rows)
    rows = (
        [
            *(shown(v) for v in settings.values()),
            str(len(group)),
            counted((units := study.units(group)).mean(SUCCESS), units.name),
            *(spread(units.mean(name), len(units.rows)) for name in (SUCCESS, *columns)),
        ]
        for settings, group in found
    )
    head = (*study.axes, "runs", "units", "success", *columns)
    block = page.rows_of("cells", head, rows, len(found), range(len(study.axes)))
    return replace(block, text=[f"Means with 95 % intervals. {UNITS}", *block.text])


def _runs(study: StudyResults) -> Block:
    left_out = ("version_", "sheet")
    names = [n for n in study.rows[0] if not n.startswith(left_out)]
    rows = ([_cell(row.get(n)) for n in names] for row in study.rows)
    return page.rows_of("runs", names, rows, len(study.rows), ())


def _cell(value: Any) -> str:
    """Return a value of a run's row as text; for a list of missed bounds, their names."""
    if isinstance(value, list) and all(isinstance(bound, dict) for bound in value):
        return ", ".join(bound["name"] for bound in value)
    return shown(value)


def _failures(study: StudyResults) -> list[Block]:
    if not study.failures:
        return []
    text = list(filter(None, [cut("failures", study.failures, MOST_FAILURES)]))
    points: list[str] = []
    for failure in study.failures[:MOST_FAILURES]:
        last = [NOTHING, *failure.error.strip().splitlines()][-1]
        points.append(f"run {failure.run}, {listed(failure.settings)}: {last}")
    code = [f"{f.command}\n\n{f.error.strip()}" for f in study.failures[:1]]
    return [Block("Runs that failed", text, points, code=code)]
