"""Trackers in the closed loop: each one steers the camera through the same scenarios."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from servo import scenario as scenarios
from servo.batch import Team, check_number, work
from servo.episode import Episode
from servo.measures import Outcome, summarise
from servo.result_folder import result_folder
from servo.scenario import Scenario
from servo.terminal import plain
from sim import gl
from tracking.evaluation import atomic
from tracking.evaluation.bench import Contender
from tracking.evaluation.csv_text import csv_text
from tracking.evaluation.jobs import number
from tracking.evaluation.statistics import bootstrap

SCENARIOS = ("still", "line")
"""What every tracker must be able to do."""
SHOWN = {
    "rms": "servo_rms_px", "peak": "servo_peak_px", "tracker": "tracking_rms_px",
    "ms": "track_ms",
}  # fmt: skip
"""Measures in the table, by the words that head them."""
RANKS = "servo_rms_px"
LEGEND = (
    "true centre against the goal, rms and peak [px]; estimate against truth, rms [px]; tracker's "
    "time [ms];\nmeans, with 95 % bootstrap intervals where there are several seeds"
)
COLUMNS = ("tracker", "follows", "scenario", "seed", "outcome")


@dataclass(frozen=True, slots=True)
class LoopJob:
    """One tracker in one scenario with one seed."""

    contender: Contender
    scenario: str
    seed: int
    changes: tuple[str, ...] = ()
    """As with --set."""

    @property
    def key(self) -> str:
        """TRACKER/SCENARIO-SEED."""
        return f"{self.contender.label}/{self.scenario}-{self.seed}"

    def describe(self) -> dict[str, Any]:
        """Tracker, scenario with all that is in its file, seed, version."""
        return {
            "tracker": self.contender.describe(),
            "scenario": self._scenario().table,
            "version": metadata.version("servobench"),
        }

    def run(self, folder: Path) -> dict[str, Any]:
        """Outcome and measures."""
        del folder
        scenario = dataclasses.replace(self._scenario(), tracker=self.contender.config)
        with Episode(scenario) as episode:
            steps = [step.light() for step in episode]
        report = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
        followed = zip(("theta", "s"), steps[-1].estimate.follows, strict=True)
        return {
            "tracker": self.contender.label,
            "follows": ", ".join(["x", "y", *(name for name, on in followed if on)]),
            "scenario": self.scenario,
            "seed": self.seed,
            "outcome": report.outcome.name,
            "measures": {m.name: number(m.value) for m in report.measures}
            | {"track_ms": 1e3 * float(np.median([s.seconds.track for s in steps]))},
        }

    def _scenario(self) -> Scenario:
        return scenarios.load(self.scenario, list(self.changes), self.seed)


def run(
    chosen: Sequence[Contender], seeds: int, workers: int, folder: Path, console: Console
) -> int:
    """Bench in the closed loop; the exit code: 1 where a run failed."""
    gl.backend()
    check_number(len(chosen) * len(SCENARIOS) * seeds)
    jobs = [LoopJob(c, name, s) for c in chosen for name in SCENARIOS for s in range(seeds)]
    with Team(workers) as team, result_folder(folder, "bench closed_loop"):
        done, code = work(jobs, folder, team, console, "bench closed loop")
        results = [d.result for d in done if d.result is not None]
        paths = _write(results, folder) if results else []
    if results:
        _print(console, results)
    for path in paths:
        plain(console, f"  {path}")
    return code


def _print(console: Console, results: Sequence[dict[str, Any]]) -> None:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for title in ("scenario", "kind", "follows", "held", *SHOWN):
        words = title in ("scenario", "kind", "follows")
        table.add_column(title, justify="left" if words else "right", no_wrap=True)
    for name in SCENARIOS:
        groups = [[r for r in results if r["scenario"] == name and r["tracker"] == label]
                  for label in dict.fromkeys(r["tracker"] for r in results)]  # fmt: skip
        for group in sorted(filter(None, groups), key=lambda g: _mean(g, RANKS)):
            held = sum(r["outcome"] == Outcome.CONVERGED.name for r in group)
            cells = [_cell(group, measure) for measure in SHOWN.values()]
            label, follows = escape(group[0]["tracker"]), group[0]["follows"]
            table.add_row(name, label, follows, f"{held}/{len(group)}", *cells)
        table.add_section()
    console.print(table)
    plain(console, LEGEND)


def _mean(group: Sequence[dict[str, Any]], measure: str) -> float:
    found = [r["measures"][measure] for r in group if r["measures"][measure] is not None]
    return float(np.mean(found)) if found else np.inf


def _cell(group: Sequence[dict[str, Any]], measure: str) -> str:
    found = [r["measures"][measure] for r in group if r["measures"][measure] is not None]
    if not found:
        return ""
    i = bootstrap(np.array(found), np.random.default_rng(0), draws=2000)
    if len(found) == 1:
        return f"{i.value:.3g}"
    return f"{i.value:.3g} [dim]{i.low:.2g}..{i.high:.2g}[/]"


def _write(results: Sequence[dict[str, Any]], folder: Path) -> list[Path]:
    names = list(results[0]["measures"])
    rows = [[*(r[c] for c in COLUMNS), *(r["measures"][n] for n in names)] for r in results]
    return [
        atomic.write(folder, "runs.csv", csv_text([*COLUMNS, *names], rows)),
        atomic.write(folder, "bench.json", json.dumps({"runs": list(results)}, indent=1) + "\n"),
    ]
