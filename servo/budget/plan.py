"""The runs of an accuracy budget (a scenario with each source of error alone, and with all
together), and the contribution of each source to the error at the end.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from servo.budget.sources import DELAY, RESOLUTION, SOURCES, TRACKER, Source, coarser, theory
from servo.mistake import Mistake
from servo.scenario.load import Scenario
from servo.scenario.toml import Table
from servo.study.run import Record
from servo.study.scenario_run import StudiedScenario
from servo.study.trials import Trial
from sim.channels import Channel, needs_of
from sim.kinds import kind_of
from sim.types import Array
from tracking.types import SEES_PICTURES, Trait, traits_of

TOGETHER = "together"
NOTHING = "nothing wrong"
BY_NAME = {source.name: source for source in SOURCES}
NO_OTHER_DELAY: Table = {
    "run.tracker_ms": 0.0,
    "run.jitter_ms": 0.0,
    "believed.clock_offset_ms": 0.0,
}
"""Settings that leave only the delay that `run.latency` or `run.latency_ms` gives."""
LAST = 1.0
"""Time at the end over which the error in the picture is averaged [s]."""


@dataclass(frozen=True, slots=True)
class Part:
    """A row of an accuracy budget: the error at the end of the runs with nothing wrong, by one
    source of error alone, or with all sources together.
    """

    name: str
    magnitude: str
    """Magnitude with its unit, and where it is from; for the tracker, its kind; "" for the rows
    with nothing wrong and with all sources together."""
    error: Array
    """Errors at the end (3,) [mm, deg, px], rms over the runs: of the camera's position and
    rotation against their goal, and of the target's centre in the picture. Of a source alone: the
    root of its mean square less that without the source."""
    theory: float | None
    """Error of the position by linear theory [mm]; None where there is none."""
    success: str
    """How many runs ended as the scenario expects, such as "7 of 8"."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs of an accuracy budget: a scenario, its seeds, and the magnitude of each source of
    error (such as a focal length that is wrong by 1 %).
    """

    base: StudiedScenario
    scenario: Scenario
    """The scenario with its first seed."""
    seeds: Sequence[int]
    stated: Mapping[str, float]
    """The magnitudes that the user states, by source."""
    own: Mapping[str, float]
    """The magnitudes that the scenario has by itself, by source; 0: it is ideal."""

    @staticmethod
    def of(base: StudiedScenario, seeds: Sequence[int], stated: Mapping[str, float]) -> "Plan":
        """Return the plan of an accuracy budget for a scenario: each source of error has the
        magnitude that the user states, else the one that the scenario has by itself, else the usual
        one.

        Args:
            base: The scenario.
            seeds: Seeds of the runs of each combination of sources.
            stated: Magnitudes that the user states, by name of the source, in its unit.
        """
        scenario = base.parsed(seeds[0], {})
        own = {source.name: source.own(scenario) for source in SOURCES}
        return Plan(base, scenario, seeds, stated, own)

    def magnitude(self, source: Source) -> float:
        """Return the magnitude of a source of error, in its unit: the one that the user states,
        else the scenario's own if it is not 0, else the usual one.
        """
        return self.stated.get(source.name, self.own[source.name] or source.usual)

    def words(self, source: Source) -> str:
        """Return the magnitude of a source of error as a text that says where it is from, such as
        "1 % (usual)"; for the tracker, its kind.
        """
        if source.name == TRACKER:
            return kind_of(self.scenario.tracker)
        usual = "the scenario's" if self.own[source.name] else "usual"
        said = "stated" if source.name in self.stated else usual
        return f"{self.magnitude(source):.3g} {source.unit} ({said})"

    def settings(self, wrong: Sequence[Source], seed: int) -> Table:
        """Return the changed settings, by dotted key, of a run in which some sources of error act
        and all others are ideal.

        Args:
            wrong: The sources that act.
            seed: Seed of the run, which also draws the signs and directions of errors.
        """
        corners = Trait.CORNERS in (traits_of(self.scenario.tracker) or ())
        names = [source.name for source in wrong]
        found: Table = {}
        if SOURCES[0] not in wrong:
            found = {"tracker.kind": "truth", "tracker.corners": corners}
        for source in SOURCES:
            stays = source.name not in self.stated and self.own[source.name] > 0
            if source not in wrong:
                found |= source.settings(0.0, seed)
            elif source.name == RESOLUTION:
                found |= coarser(self.base.parsed(seed, {}), self.magnitude(source))
            elif not stays:
                # A coarser picture divides what the scenario has in px, and this too.
                scale = self.magnitude(BY_NAME[RESOLUTION]) if RESOLUTION in names else 1.0
                size = self.magnitude(source) / (scale if source.unit == "px" else 1.0)
                found |= source.settings(size, seed)
        is_late = DELAY in names and DELAY not in self.stated and self.own[DELAY] > 0
        return found if is_late else found | NO_OTHER_DELAY

    def alone(self, source: Source) -> tuple[Source, ...]:
        """Return the sources of error that act where one is tried alone: the source itself, and
        before it the tracker if the source acts through the tracker only (as image noise does).
        """
        return (SOURCES[0], source) if source.seen else (source,)

    def reason(self, source: Source, idle: Callable[[Scenario], list[str]]) -> str:
        """Return why a scenario cannot have a source of error (such as a wrong focal length), as a
        sentence; "" if it can.

        Args:
            source: The source.
            idle: Function that takes the scenario in which the source acts, and returns a sentence
                for each setting without effect, which begins with the setting's dotted key and a
                space.
        """
        tracker = self.scenario.tracker
        if source.name == TRACKER and kind_of(tracker) == "truth":
            return "the tracker knows the truth"
        if source.seen and Channel.PICTURE not in needs_of(tracker, SEES_PICTURES):
            return "the tracker sees no pictures"
        seed = self.seeds[0]
        try:
            said = idle(self.base.parsed(seed, self.settings(self.alone(source), seed)))
        except Mistake as error:
            return str(error)
        return next((s for key in source.ideal for s in said if s.startswith(f"{key} ")), "")

    def cells(self, sources: Sequence[Source]) -> dict[str, tuple[Source, ...]]:
        """Return the sources of error that act in each combination of the budget, by the
        combination's name: "nothing wrong" has no source; each source's name has this source alone,
        or the tracker and the source if it acts only through the tracker, as image noise does; and
        "together" has all sources.
        """
        alone = {source.name: self.alone(source) for source in sources}
        return {NOTHING: (), **alone, TOGETHER: tuple(sources)}

    def trials(self, sources: Sequence[Source]) -> list[Trial]:
        """Return the runs of a budget, each as its changed settings (by dotted key) and its seed:
        all seeds of the first combination of sources, then those of the next, in the order of
        `cells`.
        """
        every = self.cells(sources).values()
        return [(self.settings(wrong, seed), seed) for wrong in every for seed in self.seeds]

    def parts(
        self, sources: Sequence[Source], records: Sequence[Record | None], focal: float
    ) -> list[Part]:
        """Return the rows of a budget: nothing wrong, each source alone, and all together. The
        error of a source alone is the root of its mean square less that without it, at least 0.

        Args:
            sources: The sources.
            records: Records of the runs of `trials`, in the same order; None for a run that failed.
            focal: Focal length of the camera [px].

        Raises:
            Mistake: All runs of a combination failed.
        """
        known = {source.name: source for source in sources}
        squares = dict[str, Array]()
        parts = list[Part]()
        count = len(self.seeds)
        for i, (name, wrong) in enumerate(self.cells(sources).items()):
            done = [record for record in records[i * count : (i + 1) * count] if record]
            if not done:
                raise Mistake(
                    f"every run of the budget's row '{name}' fails: files in the folder failures "
                    "of the results say why"
                )
            scale = self.magnitude(known[RESOLUTION]) if known.get(RESOLUTION) in wrong else 1.0
            squares[name] = np.mean([np.square(_errors(record, scale)) for record in done], axis=0)
            success = f"{sum(record.success for record in done)} of {count}"
            source = known.get(name)
            if source is None:
                parts.append(Part(name, "", np.sqrt(squares[name]), None, success))
                continue
            without = squares[TRACKER if source.seen else NOTHING]
            alone = np.sqrt(np.maximum(squares[name] - without, 0.0))
            expected = theory(source, self.magnitude(source), self.scenario, focal)
            parts.append(Part(name, self.words(source), alone, expected, success))
        return parts


def _errors(record: Record, scale: float) -> Array:
    """Return the errors at the end of a run (3,): of the camera's position [mm] and rotation [deg],
    and of the target's centre in the picture, rms over the last second [px], times `scale`.
    """
    times = record.series["time_s"]
    late = record.series["servo_error_px"][times >= times[-1] - LAST].astype(float)
    pixels = scale * float(np.sqrt(np.mean(late**2)))
    measures = record.measures
    return np.array([measures["end_position_mm"], measures["end_rotation_deg"], pixels])
