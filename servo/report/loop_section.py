"""The section about a bench in the closed loop, where each tracker steers the camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.bench.loop_jobs import LEGEND, RANKS, SHOWN, LoopBench, LoopRun
from servo.report import charts, page
from servo.report.page import Badge, Block, Cell, Fact, Section, Table, again
from servo.report.words import shown, spread
from tracking.evaluation.statistics import Interval, bootstrap


def section(folder: Path, bench: LoopBench) -> Section:
    """The section about the folder of such a bench."""
    runs = bench.runs
    trackers = list(dict.fromkeys(r.tracker for r in runs))
    names = list(dict.fromkeys(r.scenario for r in runs))
    held = sum(r.held for r in runs)
    errors = {
        name: [_mean([r for r in runs if (r.scenario, r.tracker) == (name, t)], RANKS)
               for t in trackers] for name in names
    }  # fmt: skip
    figure = charts.by_name("True centre against the goal, rms", "px", trackers, errors)
    facts = [
        Fact("runs that held", Badge.of(held == len(runs), *[f"{held} of {len(runs)}"] * 2)),
        Fact("trackers", str(len(trackers))),
        Fact("scenarios", ", ".join(names)),
    ]
    lost = [f"{r.tracker} did not hold {r.scenario}, seed {r.seed}: {r.outcome}."
            for r in runs if not r.held]  # fmt: skip
    blocks = [
        Block("Trackers", points=lost, tables=[_table(runs, names, trackers)], figures=[figure]),
        _runs(runs),
        again(bench),
    ]
    lead = "Each tracker steers the camera through the same scenarios."
    verdict = Badge.of(held == len(runs), "all held", f"{len(runs) - held} not held")
    return Section("bench", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def _mean(runs: Sequence[LoopRun], measure: str) -> Interval | None:
    found = [value for r in runs if (value := r.measures.get(measure)) is not None]
    return bootstrap(np.array(found)) if found else None


def _table(runs: Sequence[LoopRun], names: Sequence[str], trackers: Sequence[str]) -> Table:
    rows: list[list[Cell]] = []
    for name in names:
        for tracker in trackers:
            group = [r for r in runs if (r.scenario, r.tracker) == (name, tracker)]
            if group:
                held = sum(r.held for r in group)
                kept = Badge.of(held == len(group), *[f"{held} of {len(group)}"] * 2)
                cells = [spread(_mean(group, measure)) for measure in SHOWN.values()]
                rows.append([name, tracker, group[0].follows, kept, *cells])
    head = ("scenario", "tracker", "follows", "held", *SHOWN)
    return Table(head, rows, words=range(3), note=" ".join(LEGEND.split()))


def _runs(runs: Sequence[LoopRun]) -> Block:
    names = list(runs[0].measures)
    rows = ([r.tracker, r.scenario, str(r.seed), r.outcome,
             *(shown(r.measures.get(n)) for n in names)] for r in runs)  # fmt: skip
    head = ("tracker", "scenario", "seed", "outcome", *names)
    return page.rows_of("runs", head, rows, len(runs), range(2))
