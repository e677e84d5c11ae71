"""The runs of an accuracy budget, and what follows from them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from servo.budget.sources import (
    DELAY,
    RESOLUTION,
    SOURCES,
    TRACKER,
    Source,
    coarser,
    in_ms,
)
from servo.mistake import Mistake
from servo.output.formats import Made, Number
from servo.scenario.load import Scenario
from servo.scenario.toml import Table
from servo.study.run import Record
from servo.study.scenario_run import StudiedScenario
from sim.channels import Channel, needs_of
from sim.kinds import kind_of
from sim.types import Array
from tracking.types import SEES_PICTURES, Trait, traits_of

UNITS = ("mm", "deg", "px")
TOGETHER = "together"
NOTHING = "nothing wrong"
LAST = 1.0
"""Time at the end over which the error in the picture is averaged [s]."""
Runs = list[tuple[Table, int]]
"""Settings and seed of each run."""
Perform = Callable[[Sequence[tuple[Table, int]]], list[Record | None]]


@dataclass(frozen=True, slots=True)
class Part:
    """A source of error in a budget: its magnitude and its contributions to the error at the end
    (position, rotation, centre in the picture), alone.
    """

    name: str
    words: str
    magnitude: str
    """Magnitude with its unit, and where it is from."""
    alone: list[Number]
    """Contributions [mm, deg, px]: root of the mean square error with it, less that without."""
    theory: Number | None
    """The contribution to the position by linear theory [mm]; None where there is none."""
    success: int
    """Number of runs that ended as the scenario expects."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetFile(Made):
    """The contents of the file budget.json: the parts of a budget, alone and together."""

    FILE: ClassVar[str] = "budget.json"
    KIND: ClassVar[str] = "budget"

    scenario: str
    seeds: int
    parts: list[Part]
    left_out: dict[str, str]
    """Reasons by the names of the sources that the scenario cannot have."""
    floor: list[Number]
    """Errors with nothing wrong [mm, deg, px]."""
    together: list[Number]
    """Errors with everything wrong [mm, deg, px]."""
    together_success: int
    """Number of runs with everything wrong that ended as the scenario expects."""

    @property
    def summed(self) -> list[float]:
        """Return the root of the sum of squares of floor and parts [mm, deg, px]."""
        every = np.array([self.floor, *(part.alone for part in self.parts)])
        return np.sqrt((every**2).sum(axis=0)).tolist()


@dataclass(frozen=True, slots=True)
class Plan:
    """The settings of the runs of a budget."""

    base: StudiedScenario
    scenario: Scenario
    """The scenario as it is."""
    magnitudes: Mapping[str, float]
    """The magnitudes that the user states, by source."""
    sources: tuple[Source, ...] = SOURCES

    @staticmethod
    def of(base: StudiedScenario, seed: int, magnitudes: Mapping[str, float]) -> "Plan":
        """Return the plan for a scenario with a seed, which is not checked yet."""
        scenario = base.parsed(seed, {})
        return Plan(in_ms(base, scenario), scenario, magnitudes)

    def keeps(self, source: Source) -> bool:
        """Return whether a source has the magnitude that the scenario has by itself."""
        return source.name not in self.magnitudes and source.own(self.scenario) > 0

    def magnitude(self, source: Source) -> float:
        """Return the magnitude of a source: the user's, the scenario's, or else the usual one."""
        own = source.own(self.scenario)
        return self.magnitudes.get(source.name, own or source.usual)

    def settings(self, wrong: Sequence[Source], seed: int) -> Table:
        """Return the settings of a run in which some sources act, and no others."""
        found: Table = {}
        for source in self.sources:
            is_on = source in wrong
            if source.name == TRACKER:
                corners = Trait.CORNERS in (traits_of(self.scenario.tracker) or ())
                ideal: Table = {"tracker.kind": "truth", "tracker.corners": corners}
                found |= {} if is_on else ideal
            elif source.name == RESOLUTION:
                factor = self.magnitude(source)
                found |= coarser(self.base.parsed(seed, {}), factor) if is_on else {}
            elif is_on:
                found |= {} if self.keeps(source) else source.settings(self.magnitude(source), seed)
            else:
                found |= source.settings(0.0, seed)
        late = any(source.name == DELAY for source in wrong)
        return found if late else found | {"run.tracker_ms": 0.0}

    def alone(self, source: Source) -> tuple[Source, ...]:
        """Return the sources that act where one is tried alone: also the tracker if it acts through
        that only.
        """
        return (SOURCES[0], source) if source.seen else (source,)

    def reason(self, source: Source, seed: int, idle: Callable[[Scenario], list[str]]) -> str:
        """Return why the scenario cannot have a source of error; "" if it can.

        Args:
            source: The source.
            seed: The seed of the scenario that is checked.
            idle: Function that returns a sentence for each setting without effect.
        """
        needs = needs_of(self.scenario.tracker, SEES_PICTURES)
        if source.name == TRACKER and kind_of(self.scenario.tracker) == "truth":
            return "the tracker knows the truth"
        if source.seen and Channel.PICTURE not in needs:
            return "the tracker sees no pictures"
        try:
            scenario = self.base.parsed(seed, self.settings(self.alone(source), seed))
        except Mistake as error:
            return str(error)
        said = [line for line in idle(scenario) if line.startswith(tuple(source.ideal))]
        return said[0] if len(said) == len(source.ideal) > 0 else ""


def measure(
    plan: Plan, left_out: dict[str, str], seeds: Sequence[int], focal: float, perform: Perform
) -> dict[str, Any]:
    """Do the runs of a budget, and return the fields of its file.

    Args:
        plan: The settings of the runs.
        left_out: Reasons by the names of the sources that are left out.
        seeds: The seeds of each combination.
        focal: Focal length of the camera [px].
        perform: Function that does runs.
    """
    sources = [source for source in plan.sources if source.name not in left_out]
    cells: dict[str, tuple[Source, ...]] = {NOTHING: ()}
    cells |= {source.name: plan.alone(source) for source in sources}
    cells[TOGETHER] = tuple(sources)
    asked = [(plan.settings(on, seed), seed) for on in cells.values() for seed in seeds]
    records = iter(perform(asked))
    squares = dict[str, Array]()
    successes = dict[str, int]()
    for name, on in cells.items():
        found = [next(records) for _ in seeds]
        scale = next((plan.magnitude(s) for s in on if s.name == RESOLUTION), 1.0)
        errors = [_errors(record, scale) for record in found if record is not None]
        if not errors:
            raise Mistake(f"every run with {name} fails; see the files in the folder failures")
        squares[name] = np.mean(np.square(errors), axis=0)
        successes[name] = sum(record is not None and record.success for record in found)
    parts = list[Part]()
    for source in sources:
        without = squares[TRACKER if source.seen else NOTHING]
        alone = np.sqrt(np.maximum(squares[source.name] - without, 0.0))
        parts.append(
            Part(
                source.name,
                source.words,
                _words(plan, source),
                alone.tolist(),
                theory(plan, source, focal),
                successes[source.name],
            )
        )
    return {
        "parts": parts,
        "left_out": left_out,
        "floor": np.sqrt(squares[NOTHING]).tolist(),
        "together": np.sqrt(squares[TOGETHER]).tolist(),
        "together_success": successes[TOGETHER],
        "seeds": len(seeds),
    }


def theory(plan: Plan, source: Source, focal: float) -> float | None:
    """Return the contribution of a source to the position at the end by linear theory [mm]: Z dc of
    a focal length or a size that is wrong by the share dc, Z d / f of a principal point that is off
    by d px where the goal is a pose, and 0 of what only bends the way to a target at rest. None
    where this does not hold.

    Args:
        plan: The settings of the runs.
        source: The source.
        focal: Focal length of the camera [px].
    """
    scenario = plan.scenario
    goal = scenario.goal
    depth = 1e3 * (goal.depth if goal.depth_to is None else goal.depth_to)
    known = scenario.believed.goal
    if scenario.leader.id is not None:
        return None
    match source.name:
        case "focal":
            return 0.0 if known == "shown" else depth * plan.magnitude(source) / 100
        case "size":
            by_picture = scenario.sight.depth == "picture"
            return 0.0 if by_picture else depth * plan.magnitude(source) / 100
        case "principal":
            return depth * plan.magnitude(source) / focal if known == "pose" else 0.0
        case "delay" | "lag" | "play" | "mount_translation" | "depth":
            return 0.0 if kind_of(scenario.motion) == "still" else None
        case _:
            return None


def _words(plan: Plan, source: Source) -> str:
    if source.name == TRACKER:
        return kind_of(plan.scenario.tracker)
    from_where = "the scenario's" if plan.keeps(source) else "usual"
    said = "stated" if source.name in plan.magnitudes else from_where
    return f"{plan.magnitude(source):.3g} {source.unit} ({said})"


def _errors(record: Record, scale: float) -> list[float]:
    """Return the errors at the end of a run: position [mm], rotation [deg], and that of the centre
    in the picture, rms over the last second [px], times a factor.
    """
    times = record.series["time_s"]
    late = record.series["servo_error_px"][times >= times[-1] - LAST]
    pixels = scale * float(np.sqrt(np.mean(np.square(late, dtype=float))))
    return [record.measures["end_position_mm"], record.measures["end_rotation_deg"], pixels]
