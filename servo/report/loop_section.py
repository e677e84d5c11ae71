"""The section about a bench in the closed loop, where each tracker steers the camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.bench.loop_jobs import LEGEND, RANKS, SHOWN, LoopBench, LoopRun
from servo.report import charts, page
from servo.report.page import Block, Fact, Section, again
from servo.report.words import Badge, Cell, Table, shown, spread
from tracking.evaluation.statistics import Interval, bootstrap


def section(folder: Path, bench: LoopBench) -> Section:
    """The section about the folder of such a bench."""
    runs = bench.runs
    trackers = list(dict.fromkeys(r.tracker for r in runs))
    names = list(dict.fromkeys(r.scenario for r in runs))
    held = sum(r.held for r in runs)
    errors = {name: [mean(group(runs, name, t), RANKS) for t in trackers] for name in names}
    figure = charts.by_name("True centre against the goal, rms", "px", trackers, errors)
    facts = [
        Fact("runs that held", Badge.of(held == len(runs), f"{held} of {len(runs)}")),
        Fact("trackers", str(len(trackers))),
        Fact("scenarios", ", ".join(names)),
    ]
    lost = [f"{r.tracker} did not hold {r.scenario}, seed {r.seed}: {r.outcome}."
            for r in runs if not r.held]  # fmt: skip
    blocks = [
        Block("Trackers", points=lost, tables=[trackers_table(runs)], figures=[figure]),
        _runs(runs),
        again(bench),
    ]
    lead = "Each tracker steers the camera through the same scenarios."
    verdict = Badge.of(held == len(runs), "all held", f"{len(runs) - held} not held")
    return Section("bench", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def group(runs: Sequence[LoopRun], scenario: str, tracker: str) -> list[LoopRun]:
    """The runs of one tracker in one scenario."""
    return [r for r in runs if (r.scenario, r.tracker) == (scenario, tracker)]


def mean(runs: Sequence[LoopRun], measure: str) -> Interval | None:
    """Mean of a measure with its interval; None if no run has it."""
    found = [value for r in runs if (value := r.measures.get(measure)) is not None]
    return bootstrap(np.array(found)) if found else None


def trackers_table(runs: Sequence[LoopRun]) -> Table:
    """The means of each tracker in each scenario; the best tracker is the first."""
    rows: list[list[Cell]] = []
    for name in dict.fromkeys(r.scenario for r in runs):
        groups = [group(runs, name, t) for t in dict.fromkeys(r.tracker for r in runs)]
        ranked = [(mean(found, RANKS), found) for found in groups if found]
        for _, found in sorted(ranked, key=lambda one: one[0].value if one[0] else np.inf):
            held = sum(r.held for r in found)
            kept = Badge.of(held == len(found), f"{held} of {len(found)}")
            cells = [spread(mean(found, measure)) for measure in SHOWN.values()]
            rows.append([name, found[0].tracker, found[0].follows, kept, *cells])
    head = ("scenario", "tracker", "follows", "held", *SHOWN)
    return Table(head, rows, words=range(3), note=" ".join(LEGEND.split()))


def _runs(runs: Sequence[LoopRun]) -> Block:
    names = list(runs[0].measures)
    rows = ([r.tracker, r.scenario, str(r.seed), r.outcome,
             *(shown(r.measures.get(n)) for n in names)] for r in runs)  # fmt: skip
    head = ("tracker", "scenario", "seed", "outcome", *names)
    return page.rows_of("runs", head, rows, len(runs), range(2))
