"""Bounds on the measures of runs. A measure that is nan or infinite exceeds every upper bound."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.measure import COUNTED, MEASURES
from servo.loop.settings import Setup
from servo.scenario.expected import DRAWN, SUCCESS_RATE
from servo.scenario.load import Scenario
from servo.scenario.toml import is_number
from sim.kinds import kind_of
from tracking.files.json_text import number

ROUNDING = 1e-9
"""Largest effect of rounding on a measure, in the measure's unit."""
UNDECIDED = "No verdict: some drawn seeds may end otherwise (expect.drawn.success_rate)."


@dataclass(frozen=True, slots=True)
class MissedBound:
    """A bound that a run did not keep: the measure's name (or "outcome"), the run's value (None if
    it is not finite), the upper bound in the measure's unit (or the expected outcome), and whether
    it comes from [expect.drawn] (`drawn`). `str` returns a sentence.
    """

    name: str
    """Name of the measure, or "outcome"."""
    found: float | str | None
    """The run's value; None if it is not finite."""
    bound: float | str
    drawn: bool = False
    """Whether the bound comes from [expect.drawn]; False if [expect] has the same value."""

    def __str__(self) -> str:
        found = "not finite" if self.found is None else self.found
        found = f"{found:.3g}" if isinstance(found, float) else found
        most = self.bound if isinstance(self.bound, str) else f"at most {self.bound:g}"
        return f"{self.name} is {found}, expected {most}{' (expect.drawn)' if self.drawn else ''}"


def unjudged(scenario: Scenario, success: bool) -> str:
    """Return a sentence if a scenario has bounds that give this run no verdict: they are for
    another tracker, or the run did not end as expected and, by expect.drawn.success_rate, only a
    share of the seeds must. Otherwise, and for a scenario without bounds, return "".

    Args:
        scenario: The scenario of the run.
        success: Whether the run ended with the expected outcome.
    """
    return scenario.unjudged if success or scenario.success_rate is None else UNDECIDED


def missed_bounds(
    outcome: str,
    measures: Mapping[str, float],
    expect: Mapping[str, float | str],
    as_written: Mapping[str, object] | None = None,
) -> tuple[MissedBound, ...]:
    """Return the bounds that a run does not keep; a measure that is nan or infinite exceeds every
    bound.

    Args:
        outcome: Name of the run's outcome.
        measures: The run's measures by name; all names in `expect` except "outcome" are among them.
        expect: Upper bounds by measure, and the expected "outcome".
        as_written: The scenario's bounds without those in [expect.drawn]: a missed bound that
            differs from them is marked as `drawn`. None: no bound is marked.
    """
    found: list[MissedBound] = []
    written = expect if as_written is None else as_written
    for name, bound in expect.items():
        drawn = bound != written.get(name)
        if isinstance(bound, str):
            if outcome != bound:
                found.append(MissedBound(name, outcome, bound, drawn))
        elif not measures[name] <= bound:
            found.append(MissedBound(name, number(measures[name]), bound, drawn))
    return tuple(found)


def missed_lines(missed: Sequence[MissedBound], measures: Mapping[str, float | None]) -> list[str]:
    """Return a sentence for each missed bound. If no measure that counts from measure.after on has
    a value, because the run ended before that time, the last sentence names those of them that
    miss their bound, and these get no sentence of their own.

    Args:
        missed: The bounds that the run did not keep.
        measures: All measures of the run by name; None or nan: no value.
    """
    is_short = all((value := measures.get(name)) is None or np.isnan(value) for name in COUNTED)
    short = [bound.name for bound in missed if is_short and bound.name in COUNTED]
    lines = [str(bound) for bound in missed if bound.name not in short]
    if short:
        lines.append(f"{', '.join(short)}: no value, because the run ended before measure.after")
    return lines


@dataclass(frozen=True, slots=True)
class DrawnShare:
    """The number of a scenario's runs with drawn settings (`seeds`), the number of those that ended
    with the expected outcome (`ended`), and the least share that should (`success_rate`, 0 to 1).
    `str` returns a sentence.
    """

    scenario: str
    """Name of the scenario."""
    ended: int
    """Number of runs that ended with the expected outcome."""
    seeds: int
    """Number of runs with drawn settings, one for each seed."""
    success_rate: float
    """Least share of runs that should end so, from 0 to 1."""

    @property
    def missed(self) -> bool:
        """Return True if fewer than `least` runs ended with the expected outcome."""
        return self.ended < self.least

    @property
    def least(self) -> int:
        """Return the least number of runs that should end as expected: the success rate times the
        number of runs, rounded down. With a rate of 0.9 it is nine of ten runs, and none of one.
        """
        return int(self.success_rate * self.seeds + ROUNDING)  # 0.29 of 100 is 29

    def __str__(self) -> str:
        found = f"{self.ended} of {self.seeds} drawn seeds ended as expected"
        return (
            f"{self.scenario}: {found}; at least {self.least} must "
            f"(expect.drawn.success_rate: {self.success_rate:g})"
        )

    @staticmethod
    def of(runs: Sequence[tuple[Scenario, bool]]) -> "DrawnShare | None":
        """Return how many of a scenario's runs with drawn settings ended as expected; None if no
        run has drawn settings, or the scenario sets no expect.drawn.success_rate.

        Args:
            runs: For each run, its scenario (as loaded for its seed), and whether the run ended as
                expected.
        """
        counted = [(s.success_rate, success) for s, success in runs if s.success_rate is not None]
        if not counted:
            return None
        ended = sum(success for _, success in counted)
        return DrawnShare(runs[0][0].name, ended, len(counted), counted[0][0])


def doubts_of(scenario: Scenario) -> list[str]:
    """Return a sentence for each doubtful bound of a scenario: one that no run can keep, or that
    every run keeps (settle_s: every run that settles). The bounds for the scenario's own tracker
    and for all others are checked.
    """
    others = scenario.bounds.others.items()
    tables = {"expect": scenario.bounds.expect} | {f"expect.tracker.{k}": b for k, b in others}
    return [
        sentence
        for place, bounds in tables.items()
        for sentence in doubtful_bounds(bounds, scenario, place)
    ]


def doubtful_bounds(bounds: Mapping[str, object], setup: Setup, place: str = "expect") -> list[str]:
    """Return a sentence for each bound that no run can keep, such as -1 px, or that every run
    keeps, such as 200 deg (for settle_s: every run that settles).

    Args:
        bounds: Upper bounds by measure, in the measure's unit; other keys, such as "outcome", are
            skipped.
        setup: Settings of the runs.
        place: Name of the bounds' table, which begins the sentences.
    """
    found = list[str]()
    for key, bound in bounds.items():
        name = key.removeprefix(DRAWN)
        if is_number(bound) and name in MEASURES and (why := _doubt(name, bound, setup)):
            found.append(f"{place}.{key} = {bound:g}: {why}")
    return found


def _doubt(name: str, bound: float, setup: Setup) -> str:
    """Return why no run can keep an upper bound, or why every run (for settle_s: every run that
    settles) keeps it; "" if neither is known.

    Args:
        name: The measure.
        bound: The upper bound, in the measure's unit.
        setup: Settings of the runs.
    """
    measure = MEASURES[name]
    rate = setup.camera.rate
    times = np.arange(setup.frames) / rate
    counted = np.count_nonzero(times >= setup.measure.after - ROUNDING) / rate
    kept = "no run misses this bound, because"
    doubts = (
        (bound < 0, "all runs miss this bound, because no measure is below 0"),
        (
            measure.of_joints and kind_of(setup.robot) == "free",
            f"{kept} the free camera has no joints with limits",
        ),
        (
            bound < ROUNDING and not (measure.share or measure.exact),
            f"rounding errors exceed this bound; raise it above {ROUNDING:g}",
        ),
        (
            bound >= 100 and (measure.share or name == "joint_range_peak_pct"),
            f"{kept} the measure is at most 100 %",
        ),
        (bound >= 180 and measure.unit == "deg", f"{kept} no angle is above 180 deg"),
        (
            bound >= counted > 0 and name == "longest_off_s",
            f"{kept} only {counted:g} s of the run count",
        ),
        (
            bound >= times[-1] and name == "settle_s",
            f"a run of {setup.run.duration:g} s misses this bound only if it never settles",
        ),
    )
    return next((sentence for is_doubtful, sentence in doubts if is_doubtful), "")


def missed_by_cells(
    cells: Iterable[tuple[Mapping[str, object], Sequence[Mapping[str, Any]]]],
    expect: Mapping[str, float],
) -> list[str]:
    """Return a sentence for each bound that the runs with one combination of axis values do not
    keep.

    An upper bound is on the mean over these runs; it is also missed if a run has no finite value.

    Args:
        cells: For each combination: the axis values, and its rows in a table of results (values by
            column).
        expect: Upper bounds by measure, and the least "success_rate" (0 to 1).
    """
    sentences: list[str] = []
    for settings, rows in cells:
        where = ", ".join(f"{k} = {v}" for k, v in settings.items()) or "all runs"
        for name, bound in expect.items():
            if name == SUCCESS_RATE:
                rate = float(np.mean([row["success"] for row in rows]))
                if rate < bound:
                    sentences.append(f"{where}: {name} is {rate:.3g}, expected at least {bound:g}")
                continue
            found = np.array([row.get(name) for row in rows], dtype=float)  # None becomes nan
            without = np.count_nonzero(~np.isfinite(found))
            text = f"has no finite value in {without} of {len(rows)} runs"
            if without or found.mean() > bound:
                text = text if without else f"is {found.mean():.3g}"
                sentences.append(f"{where}: {name} {text}, expected at most {bound:g}")
    return sentences
