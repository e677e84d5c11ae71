"""The file report.json of a run, from which its report page is made: its results and all
settings.
"""

from dataclasses import dataclass, field
from typing import ClassVar

from servo.loop.measure import MEASURES
from servo.loop.step import Scene
from servo.output.formats import Made, Number
from servo.scenario.load import Scenario
from servo.scenario.toml import Table, is_table
from servo.study.bounds import MissedBound, unjudged
from servo.study.run import Record
from sim.outline import Outline
from tracking.files.json_text import as_json, number


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReport(Made):
    """The contents of the file report.json of a run: outcome, measures and their units by name, the
    scenario's bounds (`expect`) and those that were not kept (`missed`), and all settings.
    """

    FILE: ClassVar[str] = "report.json"
    KIND: ClassVar[str] = "run"

    scenario: str
    seed: int
    outcome: str
    """The name of an `Outcome`."""
    measures: dict[str, Number | None]
    """Values of the measures by name; None if there is no finite value."""
    units: dict[str, str]
    """Units of the measures by name."""
    expect: dict[str, Number | str]
    """The scenario's bounds for its tracker and seed; empty if the run has no verdict."""
    missed: list[MissedBound]
    """The bounds that were not kept."""
    features: dict[str, str]
    """Units of the features by name."""
    feed_forward: list[str]
    """Features for which the report plots the target's motion."""
    settings: Table
    """All settings of the run, including defaults and the target's rectangle."""
    table: Table
    """The scenario's TOML table, including changes."""
    limits: list[str] = field(default_factory=list[str])
    """The limits of joints, such as "elbow (range)", that were hit in the last second, or in the
    last second in which the target was not lost (see `Record.limits`)."""
    off: list[str] = field(default_factory=list[str])
    """Errors that were too large at the end, such as "angle 27 deg"; none unless the outcome is
    TIMED_OUT."""
    repeats: bool = True
    """Whether the same command gives the same numbers."""
    rates: dict[str, Number] = field(default_factory=dict)
    """Rates that the run used [Hz] where they differ from the settings, by setting."""
    outline_centre: list[Number] = field(default_factory=list[Number])
    """Centre of the target's reference rectangle in the target's frame: x, y, z [m]."""
    unjudged: str = ""
    """Why the run has no verdict although the scenario has bounds: they are for another tracker, or
    for many seeds; else ""."""
    uncertain: str = ""
    """A sentence about estimates that were too uncertain to be used for servoing; "" if there were
    none."""

    @staticmethod
    def of(record: Record, scenario: Scenario, scene: Scene, uncertain: str = "") -> "RunReport":
        """Return the contents of the report of a run.

        Args:
            record: Results of the run.
            scenario: The scenario that was run.
            scene: Target and features of the run, which are written too.
            uncertain: A sentence about estimates that were too uncertain to be used for servoing;
                "" if there were none.
        """
        why = unjudged(scenario, record.success)
        settings = scenario.settings()
        target = settings["target"]
        if is_table(target) and "outline" in target:  # by default it is measured on the model
            sides = Outline(scene.outline)
            target["outline"] = (sides.length, sides.width, sides.height)
        return RunReport(
            command=record.command,
            versions=record.versions,
            scenario=record.subject,
            seed=record.seed,
            outcome=record.outcome,
            measures={name: number(record.measures[name]) for name in MEASURES},
            units={name: measure.unit for name, measure in MEASURES.items()},
            expect={} if why else scenario.expect,
            missed=list(record.missed),
            features=dict(zip(scene.features.names, scene.features.units, strict=True)),
            feed_forward=list(scene.features.feed_forward),
            settings=as_json(settings),
            table=as_json(scenario.table),
            limits=list(record.limits),
            off=list(record.off),
            repeats=record.repeats,
            rates=scenario.rates_changed,
            outline_centre=scene.outline.mean(axis=0).tolist(),
            unjudged=why,
            uncertain=uncertain,
        )
