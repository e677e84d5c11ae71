"""What is known of a run at its end: report.json of `servobench run`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from servo.loop.run_measures import Report, Violation
from servo.mistake import Mistake
from servo.output.formats import Made, Number
from servo.output.versions import versions
from servo.parts import FeatureSet
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from tracking.files.json_text import as_json, number


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReport(Made):
    """Outcome, measures, bounds and settings of a run."""

    FILE: ClassVar[str] = "report.json"
    KIND: ClassVar[str] = "run"
    FORMAT: ClassVar[int] = 1

    scenario: str
    seed: int
    outcome: str
    """The name of an `Outcome`."""
    measures: dict[str, Number | None]
    """None where a measure has no finite value."""
    units: dict[str, str]
    """Of the measures, by name."""
    expect: dict[str, Number | str]
    """The scenario's bounds."""
    missed: list[Violation]
    """The bounds that were not kept."""
    features: dict[str, str]
    """Units of the features, by name."""
    feed_forward: list[str]
    """Features whose target motion is drawn."""
    settings: dict[str, Any]
    """Every value that the run used, the defaults included."""
    table: dict[str, Any]
    """The scenario as TOML has it, changes included."""
    rates: dict[str, Number] = field(default_factory=dict)
    """Rates that the run used [Hz], where the camera's rate left those asked for no whole steps."""

    @staticmethod
    def of(
        scenario: Scenario, features: FeatureSet, report: Report, missed: list[Violation],
        command: str,
    ) -> RunReport:  # fmt: skip
        """The report of a run that a command line made."""
        return RunReport(
            command=command,
            versions=versions(),
            scenario=scenario.name,
            seed=scenario.run.seed,
            outcome=report.outcome.name,
            measures={m.name: number(m.value) for m in report.measures},
            units={m.name: m.unit for m in report.measures},
            expect=scenario.expect,
            missed=missed,
            features=dict(zip(features.names, features.units, strict=True)),
            feed_forward=list(features.feed_forward),
            settings=as_json(scenario.settings()),
            table=_table(scenario),
            rates=scenario.rates_changed,
        )


def _table(scenario: Scenario) -> dict[str, Any]:
    """The table that gives these settings: its own, or all of them where Python changed a part."""
    settings = scenario.settings()
    try:
        same = scenarios.parse(scenario.table, scenario.name, scenario.name).settings() == settings
    except Mistake:
        same = False
    return as_json(
        scenario.table if same else _without_none(settings | {"expect": scenario.expect})
    )


def _without_none(value: Any) -> Any:
    """A value for TOML, which has no null: a setting that is None has its default."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
