"""The section about a bench: a comparison of trackers on sequences or in the closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.bench import loop_jobs, ranking
from servo.bench.loop_jobs import LoopBench, LoopRun, draws, mean
from servo.bench.ranking import Row, SequenceBench, SequenceRun
from servo.mistake import Mistake
from servo.output import formats
from servo.report import charts, page
from servo.report.page import Block, Fact, PageImage, Section, again
from servo.report.words import Badge, Cell, Table, Tone, basis, cut, shown, spread

CURVES = {"success.png": "Success", "precision.png": "Precision"}
MOST_SHEETS = 24
SURE = 0.05
"""Largest p value that counts as a difference between two trackers."""


def section(folder: Path) -> Section:
    """The section about the folder of a bench.

    Raises:
        Mistake: A file is missing or damaged.
    """
    path = folder / SequenceBench.FILE
    bench = formats.read(path, SequenceBench, LoopBench)
    if not bench.runs:
        raise Mistake(f"{path}: there are no runs in it")
    if isinstance(bench, LoopBench):
        return loop_section(folder, bench)
    if not bench.trackers:
        raise Mistake(f"{path}: there are no trackers in it")
    best = bench.trackers[0]
    families = families_table(bench.trackers)
    blocks = [
        Block(
            "Trackers",
            points=_compared(bench.trackers),
            tables=[trackers_table(bench.trackers)],
            pictures=[
                _picture(folder / name, title, sheet=False)
                for name, title in CURVES.items()
                if (folder / name).exists()
            ],
        ),
        *([Block("Success by sequence", tables=[families])] if families else []),
        *_sheets(folder, best.tracker),
        _runs(bench.runs),
        again(bench),
    ]
    score = best.means.get(ranking.RANKS)
    facts = [
        Fact("best tracker", best.tracker),
        Fact(
            "its success AUC",
            shown(score.value if score else None),
            basis(score, ranking.UNIT) if score else "",
        ),
        Fact("trackers", str(len(bench.trackers))),
        Fact("sequences", str(best.units or len({r.sequence for r in bench.runs}))),
        Fact("runs", str(len(bench.runs))),
    ]
    lead = "Trackers against each other on sequences with a truth."
    verdict = Badge(f"best: {best.tracker}", Tone.PLAIN)
    return Section("bench", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def _compared(trackers: Sequence[Row]) -> list[str]:
    best = trackers[0].tracker
    others = trackers[1:]
    worse = [t.tracker for t in others if t.against_best and t.p < SURE]
    alike = [t.tracker for t in others if t.tracker not in worse]
    sentences = [f"{best} tracks for longer than {', '.join(worse)} (McNemar, p < {SURE:g})."]
    doubt = [f"Not distinguished from {best} by these runs: {', '.join(alike)}."]
    return [*(sentences if worse else []), *(doubt if alike else [])]


def trackers_table(trackers: Sequence[Row]) -> Table:
    """The means of each tracker, and its test against the best one."""
    rows: list[list[str]] = []
    for t in trackers:
        means = {title: t.means.get(name) for title, name in ranking.SHOWN.items()}
        cells = {title: shown(mean and mean.value) for title, mean in means.items()}
        cells[ranking.INTERVAL] = spread(means[ranking.INTERVAL])
        test = t.against_best
        end = [shown(test.z), shown(t.p)] if test else ["", ""]
        rows.append([t.tracker, str(t.units), *cells.values(), *end])
    head = ("tracker", "n", *ranking.SHOWN, "z", "p")
    return Table(head, rows, note=" ".join(ranking.LEGEND.split()))


def families_table(trackers: Sequence[Row]) -> Table | None:
    """Success by sequence, with a column for each tracker, or for each sequence if these are fewer;
    None if there is one sequence only.
    """
    names = list(trackers[0].families)
    if len(names) < 2:
        return None
    head: list[str] = ["sequence", *(t.tracker for t in trackers)]
    rows = [[name, *(shown(t.families.get(name)) for t in trackers)] for name in names]
    if len(names) < len(trackers):
        head, *rows = map(list, zip(["tracker", *head[1:]], *rows, strict=True))
    return Table(head, rows, note="Mean success AUC.")


def _sheets(folder: Path, best: str) -> list[Block]:
    paths = sorted((folder / ranking.SHEETS).glob("*.png"))
    if not paths:
        return []
    legend = f"The first seed of each sequence: truth white, {best} green."
    text = [legend, *filter(None, [cut("sheets", paths, MOST_SHEETS)])]
    pictures = [_picture(path, path.stem, sheet=True) for path in paths[:MOST_SHEETS]]
    return [Block("Contact sheets", text, pictures=pictures)]


def _picture(path: Path, title: str, *, sheet: bool) -> PageImage:
    return PageImage.of(title, formats.content(path), str(path), sheet=sheet)


def _runs(runs: Sequence[SequenceRun]) -> Block:
    names = list(runs[0].measures)
    rows = (
        [r.tracker, r.sequence, str(r.seed), *(shown(r.measures.get(n)) for n in names)]
        for r in runs
    )
    head = ("tracker", "sequence", "seed", *names)
    return page.rows_of("runs", head, rows, len(runs), range(2))


def loop_section(folder: Path, bench: LoopBench) -> Section:
    """The section about the folder of such a bench."""
    runs = bench.runs
    trackers = list(dict.fromkeys(r.tracker for r in runs))
    names = list(dict.fromkeys(r.scenario for r in runs))
    held = sum(r.held for r in runs)
    errors = {
        name: [mean(group(runs, name, t), loop_jobs.RANKS) for t in trackers] for name in names
    }
    note = "Means over the seeds with 95 % intervals; without one where the seeds draw nothing."
    figure = charts.by_name("True centre against the goal, rms", "px", trackers, errors, note=note)
    facts = [
        Fact("runs that held", Badge.of(held == len(runs), f"{held} of {len(runs)}")),
        Fact("trackers", str(len(trackers))),
        Fact("scenarios", ", ".join(names)),
    ]
    lost = [
        f"{r.tracker} did not hold {r.scenario}, seed {r.seed}: {r.outcome}."
        for r in runs
        if not r.held
    ]
    blocks = [
        Block("Trackers", points=lost, tables=[loop_table(runs)], figures=[figure]),
        _loop_runs(runs),
        again(bench),
    ]
    lead = "Each tracker steers the camera through the same scenarios."
    verdict = Badge.of(held == len(runs), "all held", f"{len(runs) - held} not held")
    return Section("bench", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def group(runs: Sequence[LoopRun], scenario: str, tracker: str) -> list[LoopRun]:
    """The runs of one tracker in one scenario."""
    return [r for r in runs if (r.scenario, r.tracker) == (scenario, tracker)]


def loop_table(runs: Sequence[LoopRun]) -> Table:
    """The means of each tracker in each scenario; the best tracker is the first."""
    rows: list[list[Cell]] = []
    for name in dict.fromkeys(r.scenario for r in runs):
        groups = [group(runs, name, t) for t in dict.fromkeys(r.tracker for r in runs)]
        ranked = [(mean(found, loop_jobs.RANKS), found) for found in groups if found]
        for _, found in sorted(ranked, key=lambda one: one[0].value if one[0] else np.inf):
            held = sum(r.held for r in found)
            kept = Badge.of(held == len(found), f"{held} of {len(found)}")
            count = len(found) if draws(found) else 1
            units = f"{count} seeds" if count > 1 else "1 run"
            cells = [spread(mean(found, name), count) for name in loop_jobs.SHOWN.values()]
            rows.append([name, found[0].tracker, found[0].follows, kept, units, *cells])
    head = ("scenario", "tracker", "follows", "held", "units", *loop_jobs.SHOWN)
    return Table(head, rows, words=range(3), note=" ".join(loop_jobs.LEGEND.split()))


def _loop_runs(runs: Sequence[LoopRun]) -> Block:
    names = list(runs[0].measures)
    rows = (
        [r.tracker, r.scenario, str(r.seed), r.outcome, *(shown(r.measures.get(n)) for n in names)]
        for r in runs
    )
    head = ("tracker", "scenario", "seed", "outcome", *names)
    return page.rows_of("runs", head, rows, len(runs), range(2))
