"""A closed-loop run as a job; its result has measures, and errors and velocities over time."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from servo.loop.episode import measured_run
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from tracking.files.json_text import number

ALONG = "yn"
"""The feature along which the car of `reversal` drives back and forth."""


@dataclass(frozen=True, slots=True)
class LoopSeries:
    """One scenario with one estimator and one seed."""

    scenario: str
    estimator: str
    seed: int
    changes: tuple[str, ...] = ()
    """As with --set."""
    label: str = ""
    """Distinguishes jobs that differ in `changes` only."""

    @property
    def key(self) -> str:
        """SCENARIO-ESTIMATOR-SEED, and the label if any."""
        parts = [self.scenario, self.label, self.estimator, str(self.seed)]
        return "loop/" + "-".join(filter(None, parts))

    def describe(self) -> dict[str, Any]:
        """The scenario with all its settings, and the version."""
        return {"scenario": self._scenario().table, "version": metadata.version("servobench")}

    def run(self, folder: Path) -> dict[str, Any]:
        """Measures and series."""
        del folder
        scenario = self._scenario()
        steps, report = measured_run(scenario)
        along = steps[0].scene.features.names.index(ALONG)
        return {
            "scenario": self.scenario, "estimator": self.estimator, "seed": self.seed,
            "label": self.label,
            "measures": {m.name: number(m.value) for m in report.measures},
            "time": [s.frame.time for s in steps],
            "servo_error": [s.servo_error for s in steps],
            "estimated": [float(s.prediction.motion[along]) for s in steps],
            "true": [number(float(s.target_motion_true[along])) for s in steps],
        }  # fmt: skip

    def _scenario(self) -> Scenario:
        changes = [f"estimator.kind={self.estimator}", *self.changes]
        return scenarios.load(self.scenario, changes, self.seed)
