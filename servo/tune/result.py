"""The file tune.json: the settings that a search tried, and the best ones on fresh seeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import tomli_w

from servo.output.formats import Made, Number
from servo.scenario.draws import Draw
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.toml import Table, put
from servo.study.scenario_run import RECORDED
from servo.tune.aim import NAMES, Aim, Values, column
from servo.tune.search import Candidate, Found
from tracking.statistics.comparisons import Interval, clopper_pearson, mean_of

EFFORT = "effort_rms_mm_s"
FRESH = 1001
"""The first fresh seed."""
FIRST_SEED = 1
"""The first seed of a search: seed 0 draws no settings."""
LONGEST_SEARCH = FRESH - FIRST_SEED
"""Most seeds of a candidate."""

Stored = dict[str, Number | None]
"""Values of a run by measure; None: without a finite value."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Settings that a search tried, with the means of their runs."""

    settings: dict[str, Any]
    runs: int
    means: Stored
    """Means over the runs with a finite value."""
    keeps: bool
    """Whether the means keep all conditions."""

    @staticmethod
    def of(aim: Aim, one: Candidate) -> "Tried":
        """Return the settings and means of a candidate."""
        means: Stored = {}
        for name in (aim.minimise, EFFORT, *(c.name for c in aim.keep)):
            found = column(one.runs, name)
            means[name] = float(found[found == found].mean()) if (found == found).any() else None
        return Tried(one.settings, len(one.runs), means, aim.score(one.runs).violation == 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneFile(Made):
    """The contents of the file tune.json: what was searched, tried and chosen, and how the chosen
    settings do on seeds that the search has not seen.
    """

    FILE: ClassVar[str] = "tune.json"
    KIND: ClassVar[str] = "tune"

    scenario: str
    minimise: str
    """The measure that is minimised."""
    keep: list[str]
    """The conditions, such as "success_rate>=0.95"."""
    searched: dict[str, dict[str, list[Any]]]
    """The distribution of each setting, by its key."""
    own: dict[str, Any]
    """Values of these settings in the scenario as it is."""
    seeds: list[int]
    """Seeds of the search."""
    tried: list[Tried]
    """All candidates in their order; the first is the scenario as it is."""
    best: int
    """Number of the best candidate."""
    lines: str
    """TOML of the best settings."""
    fresh_seeds: list[int]
    before: list[Stored]
    """Values of the scenario as it is, for each fresh seed."""
    after: list[Stored]
    """Values of the best settings, for each fresh seed."""

    @property
    def gain(self) -> Interval | None:
        """The measure before minus that after, as a mean over fresh seeds with its 95 % interval;
        None without a value.
        """
        pairs = column(_known(self.before), self.minimise) - column(
            _known(self.after), self.minimise
        )
        pairs = pairs[pairs == pairs]
        return mean_of(pairs) if len(pairs) else None

    @property
    def broken(self) -> list[str]:
        """Return a sentence for each condition that the best settings break on fresh seeds."""
        found = list[str]()
        for condition in Aim.read(self.minimise, self.keep).keep:
            values = column(_known(self.after), condition.name)
            if condition.excess(values).mean() > 0:
                found.append(
                    f"{condition}: the mean over fresh seeds is {values.mean():.3g}, so that this "
                    "condition is not kept"
                )
        return found


def fresh_rows(file: TuneFile) -> list[tuple[str, str, Interval | None, Interval | None]]:
    """Return name, unit, and the means before and after with 95 % intervals, of each measure of
    interest on fresh seeds; the success rate has the interval of Clopper and Pearson.
    """
    conditions = (c.name for c in Aim.read(file.minimise, file.keep).keep)
    rows: list[tuple[str, str, Interval | None, Interval | None]] = []
    for name in dict.fromkeys((file.minimise, SUCCESS_RATE, *conditions, EFFORT)):
        unit = RECORDED[name].unit if name in RECORDED else ""
        both = [_interval(name, values) for values in (file.before, file.after)]
        rows.append((name, unit, both[0], both[1]))
    return rows


def tuned(
    aim: Aim,
    draws: Sequence[Draw],
    found: Found,
    fresh: tuple[Sequence[int], Sequence[Values], Sequence[Values]],
    **made: Any,
) -> TuneFile:
    """Return the contents of tune.json.

    Args:
        aim: The measure and the conditions.
        draws: The settings that were searched.
        found: The result of the search.
        fresh: Fresh seeds, and values of the scenario as it is and of the best settings.
        **made: The scenario's name, command and versions.
    """
    seeds, before, after = fresh
    return TuneFile(
        minimise=aim.minimise,
        keep=[str(condition) for condition in aim.keep],
        searched={d.key: {d.law: list(d.numbers)} for d in draws},
        seeds=list(found.seeds),
        tried=[Tried.of(aim, one) for one in found.tried],
        best=found.tried.index(found.best),
        lines=toml_of(found.best.settings),
        fresh_seeds=list(seeds),
        before=[_stored(run) for run in before],
        after=[_stored(run) for run in after],
        **made,
    )


def toml_of(settings: Table) -> str:
    """Return settings by dotted key as lines of TOML, to be pasted into a scenario's file."""
    table: Table = {}
    for key, value in settings.items():
        put(table, key, value, key)
    return tomli_w.dumps(table)


def _interval(name: str, runs: Sequence[Stored]) -> Interval | None:
    values = column(_known(runs), name)
    values = values[values == values]
    if not len(values):
        return None
    if name == SUCCESS_RATE:
        return clopper_pearson(int(values.sum()), len(values))
    return mean_of(values, least=0.0)


def _known(runs: Sequence[Stored]) -> list[Values]:
    return [{name: value for name, value in run.items() if value is not None} for run in runs]


def _stored(run: Values) -> Stored:
    return {name: value for name, value in run.items() if name in NAMES}
