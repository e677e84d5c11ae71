"""Everything a run writes: DIR/run.rrd, steps.parquet, report.json and two plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from servo import plots
from servo.episode import Episode
from servo.measures import Report, Violation
from servo.mistake import Mistake
from servo.scenario import Scenario
from servo.step import Step
from servo.steps_table import TABLE, StepsTable
from servo.versions import versions
from tracking.evaluation.jobs import number

RECORDING, REPORT = "run.rrd", "report.json"


def prepare(asked: Path | None, name: str) -> Path:
    """The empty folder a run will write to: the one asked for, or the next free runs/NAME.

    Raises:
        Mistake: It holds something already, or cannot be written.
    """
    if asked is None:
        base = Path("runs") / name
        folder, again = base, 2
        while folder.exists():
            folder, again = base.with_name(f"{base.name}-{again}"), again + 1
    else:
        folder = asked
    try:
        str(folder).encode()
    except UnicodeEncodeError:
        raise Mistake(
            f"{folder}: recordings need a folder whose name is UTF-8; choose another with --out"
        ) from None
    try:
        if folder.is_dir() and any(folder.iterdir()):
            raise Mistake(f"{folder}: there is something in this folder; choose another with --out")
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / RECORDING
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise Mistake(f"{folder}: cannot write to this folder: {error.strerror}") from None
    return folder


class RunFolder:
    """Takes the steps of one run as they come, and what is left at its end."""

    def __init__(self, folder: Path, episode: Episode, *, rerun: bool) -> None:
        self.folder, self._scenario = folder, episode.scenario
        rows = max(1, round(episode.scenario.camera.rate))
        self._table = StepsTable(folder, episode.world.robot, rows)
        self._log = None
        if rerun:
            from servo.recording.log import RerunLog  # rerun takes half a second to import

            self._log = RerunLog(folder / RECORDING, episode)

    def add(self, step: Step) -> None:
        """Write a step."""
        self._table.add(step)
        if self._log:
            self._log.add(step)

    def close(self) -> None:
        """Finish recording and table, which then hold every step they were given."""
        if self._log:
            self._log.close()
        self._table.close()

    def finish(
        self, steps: Sequence[Step], report: Report, missed: Sequence[Violation]
    ) -> list[Path]:
        """Write report and plots; the paths of everything written."""
        text = json.dumps(_summary(self._scenario, report, missed), indent=2, allow_nan=False)
        (self.folder / REPORT).write_text(text + "\n", encoding="utf-8")
        title = f"{self._scenario.name}, seed {self._scenario.run.seed}"
        drawn = plots.draw(steps, title, self._scenario.features.scaling.unit, self.folder)
        recording = [self.folder / RECORDING] if self._log else []
        return [*recording, self.folder / TABLE, self.folder / REPORT, *drawn]


def _summary(scenario: Scenario, report: Report, missed: Sequence[Violation]) -> dict[str, Any]:
    return {
        "scenario": scenario.name,
        "seed": scenario.run.seed,
        "outcome": report.outcome.name,
        "measures": {m.name: number(m.value) for m in report.measures},
        "units": {m.name: m.unit for m in report.measures},
        "expect": scenario.expect,
        "missed": [str(v) for v in missed],
        "settings": json.loads(json.dumps(scenario.settings(), default=lambda e: e.value)),
        "versions": versions(),
    }
