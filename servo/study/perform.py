"""One run of a study, from its settings to its row: the task of the workers."""

from __future__ import annotations

import platform
from typing import Any

import numpy as np

from servo.loop.episode import measured_run
from servo.loop.run_measures import CONVERGED_PX, Outcome, violations
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.versions import versions
from servo.scenario.load import Scenario
from servo.scenario.named_files import digest_of
from servo.study.plan import Run
from sim.kinds import UnknownKind
from tracking.evaluation.drawing.contact_sheet import encoded, page, tile
from tracking.evaluation.sequences.sources import Picture
from tracking.files.json_text import number

Row = dict[str, Any]
TILES, JPEG_QUALITY = 8, 80
TIMED = ("step_ms", "track_ms")
"""Columns of measured times, which differ when a run is repeated."""


def perform(run: Run) -> Row:
    """Do a run; its row, by column.

    Raises:
        Mistake: A setting is not valid.
    """
    scenario = _parsed(run)
    last = scenario.frames - 1
    wanted = set(np.linspace(0, last, TILES).astype(int)) if run.pictured else set()
    tiles: list[Any] = []

    def keep(step: Step) -> None:
        if step.frame.index in wanted:
            tiles.append(_tile(step))

    steps, report = measured_run(scenario, keep)
    hoped = scenario.expect.get("outcome", Outcome.CONVERGED.name)
    return {
        "run": run.number,
        "scenario": run.scenario,
        "seed": run.seed,
        **run.settings,
        "outcome": report.outcome.name,
        "success": report.outcome.name == hoped,
        "missed": [
            {"name": v.name, "found": _text(v.found), "bound": _text(v.bound)}
            for v in violations(report, scenario.expect)
        ],
        **{m.name: number(m.value) for m in report.measures},
        "track_ms": 1e3 * float(np.median([s.seconds.track for s in steps])),
        **version_columns(),
        **_series(steps),
        "sheet": encoded(page(tiles), JPEG_QUALITY) if tiles else None,
    }


def _parsed(run: Run) -> Scenario:
    """The scenario of a run; where the study began it was right, so a kind is missing here only."""
    for path, digest in run.files.items():
        if digest_of(path) != digest:
            raise Mistake(
                f"on {platform.node()}, the file {path} is not the one that the study began with"
            )
    try:
        return run.parsed()
    except Mistake as error:
        if not isinstance(error.__cause__, UnknownKind):
            raise
        raise Mistake(f"the worker on {platform.node()} lacks a package: {error}") from error


def _text(value: float | str | None) -> str | None:
    return None if value is None else str(value)


def version_columns() -> dict[str, str]:
    """The versions that decide the numbers, by column."""
    return {
        f"version_{name.replace('-', '_').replace(' ', '_')}": version
        for name, version in versions().items()
    }


def _series(steps: list[Step]) -> dict[str, list[Any]]:
    errors = [s.tracking_error for s in steps]
    return {
        "time_s": [s.frame.time for s in steps],
        "servo_error_px": [s.servo_error for s in steps],
        "tracking_error_px": errors,
        "on_target": [error <= CONVERGED_PX for error in errors],
    }


def _tile(step: Step) -> Any:
    picture = Picture(f"{step.frame.time:.1f} s", step.frame.time, step.frame.image)
    return tile(picture, step.truth.corners, step.estimate.outline(step.region))
