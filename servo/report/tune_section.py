"""The section of an HTML report about a search for settings: the lines to paste, the measures on
fresh seeds, response curves, and the front of error against effort.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.report import page
from servo.report.charts import Curve, Scale, colour, curves
from servo.report.page import Block, Fact, Figure, Section
from servo.report.words import Badge, Table, Tone, listed, shown, spread
from servo.study.scenario_run import RECORDED
from servo.tune.result import EFFORT, Tried, TuneFile, fresh_rows

WIDE = 4.0
"""Ratio of values from which an axis of a figure is logarithmic."""
AS_IT_IS = "the scenario as it is"
BEST = "the best settings"


def section(folder: Path) -> Section:
    """Return the section about a folder that `servobench tune` wrote.

    Raises:
        Mistake: The file tune.json is missing or damaged.
    """
    file = TuneFile.read(folder / TuneFile.FILE)
    figures = [*_responses(file), *_front(file)]
    blocks = [
        *([Block("On fresh seeds", tables=[fresh_table(file)])] if file.after else []),
        Block("The lines for the scenario's file", code=[file.lines] if file.lines else []),
        Block("What each setting does", [_points(file)], figures=figures),
        _tried(file),
        page.again(file),
    ]
    tone = Tone.BAD if file.broken or not file.after else Tone.GOOD
    verdict = "conditions kept" if tone is Tone.GOOD else "conditions missed"
    runs = sum(one.runs for one in file.tried)
    facts = [
        Fact("minimised", file.minimise, ", ".join(file.keep)),
        Fact("candidates", str(len(file.tried)), f"{runs} runs, {len(file.seeds)} seeds at most"),
    ]
    title = f"{file.scenario}, tuned"
    return Section("tune", title, sentence(file), Badge(verdict, tone), facts, blocks, str(folder))


def sentence(file: TuneFile) -> str:
    """Return the result of a search in a sentence or two."""
    best = file.tried[file.best]
    chosen = listed(best.settings)
    if not file.after:
        means = listed(best.means)
        return (
            f"no settings among {len(file.tried)} candidates keep {' and '.join(file.keep)}; the "
            f"nearest are {chosen or AS_IT_IS}, with {means}: allow more, search wider ranges "
            "(--settings), or give more runs (--budget)"
        )
    if not best.settings:
        return f"No candidate is better than {AS_IT_IS}."
    gain = file.gain
    if gain is None:
        return f"Best: {chosen}."
    before = fresh_rows(file)[0][2]
    share = f", {100 * gain.value / before.value:.0f} %" if before and before.value else ""
    unit = RECORDED[file.minimise].unit if file.minimise in RECORDED else ""
    doubt = " This gain is not certain." if gain.known and gain.low <= 0 else ""
    return (
        f"Best: {chosen}. {file.minimise} is lower by {spread(gain)} {unit}{share}, as a mean over "
        f"{len(file.fresh_seeds)} fresh seeds.{doubt}"
    )


def fresh_table(file: TuneFile) -> Table:
    """Return the table of measures on fresh seeds, before and after."""
    rows = [
        [name, unit, spread(before), spread(after)]
        for name, unit, before, after in fresh_rows(file)
    ]
    if file.gain is not None:
        rows.append([f"{file.minimise}, less", rows[0][1], "", spread(file.gain)])
    note = (
        f"Means over {len(file.fresh_seeds)} seeds that the search has not seen, with 95 % "
        "intervals (success: Clopper and Pearson; the last row: paired)."
    )
    return Table(("measure", "unit", AS_IT_IS, BEST), rows, words=range(2), note=note)


def _points(file: TuneFile) -> str:
    return (
        f"Each point is a candidate, the mean of {file.minimise} over its seeds. Candidates that "
        "were stopped early or break a condition are pale; other settings vary from point to point."
    )


def _responses(file: TuneFile) -> list[Figure]:
    """Return a figure of the minimised measure against each setting of numbers."""
    numeric = [key for key, laws in file.searched.items() if "choice" not in laws]
    return [
        _scatter(file, key, key, [one.settings.get(key) for one in file.tried]) for key in numeric
    ]


def _value(file: TuneFile, one: Tried, key: str) -> float | None:
    """Return the value of a setting that a candidate has; None where a kind replaces it."""
    is_own = not one.settings or key.endswith(".kind")
    return one.settings.get(key, file.own[key] if is_own else None)


def _front(file: TuneFile) -> list[Figure]:
    """Return the figure of the minimised measure against the effort, if both are there."""
    if file.minimise == EFFORT:
        return []
    efforts = [one.means.get(EFFORT) for one in file.tried]
    return [_scatter(file, "Error against effort", f"{EFFORT} [mm/s]", efforts, front=True)]


def _scatter(
    file: TuneFile, title: str, x: str, across: Sequence[float | None], front: bool = False
) -> Figure:
    """Return a figure of the minimised measure of each candidate against a value of it."""
    full = max(one.runs for one in file.tried)
    groups = {"": list[int](), "candidates": list[int](), AS_IT_IS: [0], BEST: [file.best]}
    for i, one in enumerate(file.tried):
        groups["candidates" if one.keeps and one.runs == full else ""].append(i)
    drawn = list[Curve]()
    for number, (label, members) in enumerate(groups.items()):
        known = [(across[i], _mean(file, file.tried[i])) for i in members]
        points = np.array([p for p in known if None not in p], float).reshape(-1, 2)
        if not len(points):
            continue
        if front and label == "candidates":
            points = points[np.argsort(points[:, 0])]
            lowest = points[points[:, 1] <= np.minimum.accumulate(points[:, 1])]
            drawn.append(Curve("front", *lowest.T, colour=colour(3), dashed=True))
        ink = colour(number)
        drawn.append(Curve(label, *points.T, colour=ink, faint=not label, marks=True))
    unit = RECORDED[file.minimise].unit if file.minimise in RECORDED else ""
    return curves(
        title, Scale(x, log_from=WIDE), Scale(f"{file.minimise} [{unit}]", log_from=WIDE), drawn
    )


def _mean(file: TuneFile, one: Tried) -> float | None:
    return one.means.get(file.minimise)


def _tried(file: TuneFile) -> Block:
    """Return the block with the table of all candidates."""
    keys = list(file.searched)
    names = list(file.tried[0].means)
    rows = (
        [
            *(shown(_value(file, one, key)) for key in keys),
            str(one.runs),
            "yes" if one.keeps else "no",
            *(shown(one.means.get(name)) for name in names),
        ]
        for one in file.tried
    )
    head = (*keys, "runs", "keeps", *names)
    return page.rows_of("candidates", head, rows, len(file.tried), ())
