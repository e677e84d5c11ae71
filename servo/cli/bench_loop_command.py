"""The command `servobench bench closed_loop`: compare trackers that steer the camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from servo.batch.workers import Workers, check_number
from servo.bench import loop_jobs
from servo.bench.loop_jobs import LEGEND, RANKS, SHOWN, LoopJob, write
from servo.bench.sequence_jobs import Contender
from servo.cli.job_progress import work
from servo.cli.terminal import columns, plain
from servo.loop.run_measures import Outcome
from servo.output.result_folder import result_folder
from sim import gl
from tracking.evaluation.statistics import bootstrap


def run(
    chosen: Sequence[Contender], seeds: int, workers: int, folder: Path, console: Console,
    command: str,
) -> int:  # fmt: skip
    """Compare trackers in the closed loop; the exit code: 1 if a run failed."""
    gl.backend()
    check_number(len(chosen) * len(loop_jobs.SCENARIOS) * seeds)
    jobs = [
        LoopJob(c, name, s) for c in chosen for name in loop_jobs.SCENARIOS for s in range(seeds)
    ]
    with Workers(workers) as pool, result_folder(folder, "bench closed_loop"):
        done, code = work(jobs, folder, pool, console, "bench closed loop")
        results = [d.result for d in done if d.result is not None]
        paths = write(results, folder, command) if results else []
    if results:
        _print(console, results)
    for path in paths:
        plain(console, f"  {path}")
    return code


def _print(console: Console, results: Sequence[dict[str, Any]]) -> None:
    words = ("scenario", "kind", "follows")
    table = columns((*words, "held", *SHOWN), words, no_wrap=True, collapse_padding=True)
    for name in loop_jobs.SCENARIOS:
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


def _values(group: Sequence[dict[str, Any]], measure: str) -> list[float]:
    return [v for r in group if (v := r["measures"][measure]) is not None]


def _mean(group: Sequence[dict[str, Any]], measure: str) -> float:
    found = _values(group, measure)
    return float(np.mean(found)) if found else np.inf


def _cell(group: Sequence[dict[str, Any]], measure: str) -> str:
    found = _values(group, measure)
    if not found:
        return ""
    i = bootstrap(np.array(found))
    if len(found) == 1:
        return f"{i.value:.3g}"
    return f"{i.value:.3g} [dim]{i.low:.2g}..{i.high:.2g}[/]"
