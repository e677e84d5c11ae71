"""The section of an HTML report about a search for settings: the lines to paste, the measures on
fresh seeds, response curves, and the front of error against effort.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomli_w

from servo.report import page
from servo.report.charts import Curve, Scale, colour, curves
from servo.report.page import Block, Fact, Figure, Section
from servo.report.words import NOTHING, Badge, Table, listed, shown, spread
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.toml import Table as Settings
from servo.scenario.toml import put
from servo.study.scenario_run import RECORDED
from servo.study.store import StudyFile
from servo.tune.search import Aim, Candidate, Values, column
from tracking.statistics.comparisons import Interval, clopper_pearson, mean_of

EFFORT = "effort_rms_mm_s"
WIDE = 4.0
"""Ratio of the values (see `Scale`) above which an axis of a figure is logarithmic."""
AS_IT_IS = "as it is"
BEST = "best"
POINTS = (
    "Each point is a candidate, with the mean over its seeds. Candidates that were stopped early "
    "or break a condition are pale; other settings vary from point to point."
)
NOTE = (
    "Means over seeds that the search has not seen, with 95 % intervals (success: Clopper and "
    "Pearson; less: paired)."
)


@dataclass(frozen=True, slots=True)
class Tuned:
    """The result of a search for the best settings of a scenario: what was tried and found, and
    runs of the scenario as it is (`before`) and with the best settings (`after`) on fresh seeds,
    which the search has not used.
    """

    aim: Aim
    own: Settings
    """Values of the searched settings in the scenario as it is, by dotted key."""
    tried: list[Candidate]
    """All candidates in their order; the first is the scenario as it is."""
    best: Candidate
    before: Sequence[Values]
    """Measures of the scenario's runs as it is, with fresh seeds; none if no candidate keeps the
    conditions and has a value of the minimised measure in each run."""
    after: Sequence[Values]
    """Measures of the runs with the best settings and the same seeds."""

    @property
    def lines(self) -> str:
        """The best settings as lines of TOML, for the scenario's file; "" if the scenario as it is
        is best.
        """
        table: Settings = {}
        for key, value in self.best.settings.items():
            put(table, key, value, key)
        return tomli_w.dumps(table)

    @property
    def measures(self) -> list[str]:
        """Names of the measures to show, each once: the one that is minimised, the success rate,
        those with a condition, and the effort.
        """
        kept = (condition.name for condition in self.aim.keep)
        return list(dict.fromkeys((self.aim.minimise, SUCCESS_RATE, *kept, EFFORT)))

    @property
    def gain(self) -> Interval | None:
        """By how much the best settings lower the minimised measure, in its unit: before minus
        after, as a mean over fresh seeds with its 95 % interval. None if no seed has both values.
        """
        before, after = (column(runs, self.aim.minimise) for runs in (self.before, self.after))
        return _mean("", before - after)

    @property
    def broken(self) -> list[str]:
        """A sentence for each condition that the best settings break on fresh seeds; empty if they
        break none, or were not run.
        """
        return [
            f"{c}: on fresh seeds {c.name} is {spread(_mean(c.name, column(self.after, c.name)))}"
            for c in self.aim.keep
            if self.after and c.excess(self.after).mean() > 0
        ]

    @property
    def sentence(self) -> str:
        """The result of the search in a sentence or two: the best settings and their gain, or why
        there are none.
        """
        chosen = listed(self.best.settings) or f"those of the scenario {AS_IT_IS}"
        if not self.after:
            names = self.measures
            means = {name: float(column(self.best.runs, name).mean()) for name in names}
            return (
                f"no settings among {len(self.tried)} candidates "
                f"{' and '.join(f'keep {c}' for c in self.aim.keep) or 'have a value in each run'}"
                f"; the nearest are {chosen}, with {listed(means)}: relax the conditions (--keep), "
                "search wider ranges (--settings), or give more runs (--budget)"
            )
        if not self.best.settings:
            return f"No candidate is better than the scenario {AS_IT_IS}."
        gain = self.gain
        if gain is None:
            return (
                f"The best settings are {chosen}. By how much they lower {self.aim.minimise} is "
                f"not known: none of {len(self.after)} fresh seeds has a value with them and with "
                f"the scenario {AS_IT_IS}."
            )
        certain = gain.low > 0
        return (
            f"The best settings are {chosen}: {self.aim.minimise} is lower by {spread(gain)} as a "
            f"mean over {len(self.after)} fresh seeds.{'' if certain else ' This is not certain.'}"
        )

    def table(self) -> Table:
        """Return the table of measures on fresh seeds, as means with 95 % intervals: of the
        scenario as it is, and of the best settings. The last row is `gain`.
        """
        rows = [
            [name, _unit(name), *(spread(_mean(name, column(r, name))) for r in both)]
            for both in [(self.before, self.after)]
            for name in self.measures
        ]
        rows.append([f"{self.aim.minimise}, less", _unit(self.aim.minimise), "", spread(self.gain)])
        return Table(("measure", "unit", AS_IT_IS, BEST), rows, words=range(2), note=NOTE)


def section(tuned: Tuned, made: StudyFile, folder: Path) -> Section:
    """Return the section of an HTML report about a search for settings.

    Args:
        tuned: The result of the search.
        made: Description of the runs: the scenario, the command and its versions.
        folder: The folder of the runs.
    """
    numeric = [key for key, value in tuned.own.items() if not isinstance(value, str)]
    figures = [
        _scatter(tuned, key, key, [_setting(tuned, t, key) for t in tuned.tried]) for key in numeric
    ]
    efforts = [float(np.mean(column(one.runs, EFFORT))) for one in tuned.tried]
    figures.append(_scatter(tuned, "Error against effort", f"{EFFORT} [mm/s]", efforts))
    head = (*tuned.own, "runs", "keeps", *tuned.measures)
    rows = (
        [
            *(shown(_setting(tuned, one, key)) for key in tuned.own),
            str(len(one.runs)),
            shown(tuned.aim.score(one.runs)[0] == 0),
            *(shown(float(column(one.runs, name).mean())) for name in tuned.measures),
        ]
        for one in tuned.tried
    )
    blocks = [
        Block("On fresh seeds", tables=[tuned.table()] if tuned.after else []),
        Block("The lines for the scenario's file", code=[tuned.lines or NOTHING]),
        Block("What each setting does", [POINTS], figures=figures),
        page.rows_of("candidates", head, rows, len(tuned.tried), ()),
        page.again(made),
    ]
    kept = bool(tuned.after) and not tuned.broken
    keep = ", ".join(map(str, tuned.aim.keep))
    runs = f"{sum(len(one.runs) for one in tuned.tried)} runs"
    facts = [
        Fact("minimised", tuned.aim.minimise, keep),
        Fact("candidates", str(len(tuned.tried)), runs),
    ]
    verdict = Badge.of(kept, "conditions kept", "conditions missed")
    title = f"{', '.join(made.scenarios)}, tuned"
    return Section("tune", title, tuned.sentence, verdict, facts, blocks, str(folder))


def _setting(tuned: Tuned, one: Candidate, key: str) -> object:
    """Return the value of a searched setting in a candidate; None if the candidate has another kind
    of component in place of the one that has this setting.
    """
    is_own = not one.settings or key.endswith(".kind")
    return one.settings.get(key, tuned.own[key] if is_own else None)


def _scatter(tuned: Tuned, title: str, x: str, across: Sequence[object]) -> Figure:
    """Return a figure of the minimised measure (mean over the runs) of each candidate against
    another value of the candidate.

    Args:
        tuned: The result of the search.
        title: Title of the figure.
        x: Title of the horizontal axis. If it begins with `EFFORT`, the figure also has the Pareto
            front of measure and effort, of the candidates that keep the conditions in all runs.
        across: The value of each candidate on the horizontal axis; None: the candidate is left out.
    """
    name = tuned.aim.minimise
    along = [float(np.mean(column(one.runs, name))) for one in tuned.tried]
    points = np.array(list(zip(across, along, strict=True)), float)
    full = np.array(
        [
            tuned.aim.score(one.runs)[0] == 0 and len(one.runs) == len(tuned.best.runs)
            for one in tuned.tried
        ]
    )
    is_best = np.array([one is tuned.best for one in tuned.tried])
    is_first = np.arange(len(points)) == 0
    groups = {"": ~full, "candidates": full, AS_IT_IS: is_first, BEST: is_best}
    drawn = [
        Curve(label, *points[chosen].T, colour=colour(i), faint=not label, marks=True)
        for i, (label, chosen) in enumerate(groups.items())
        if np.isfinite(points[chosen]).all(axis=1).any()
    ]
    if x.startswith(EFFORT) and full.any():
        ordered = points[full][np.argsort(points[full][:, 0])]
        front = ordered[ordered[:, 1] <= np.minimum.accumulate(ordered[:, 1])]
        drawn.append(Curve("front", *front.T, colour=colour(4), dashed=True))
    return curves(
        title, Scale(x, log_from=WIDE), Scale(f"{name} [{_unit(name)}]", log_from=WIDE), drawn
    )


def _unit(name: str) -> str:
    return RECORDED[name].unit if name in RECORDED else ""


def _mean(name: str, values: Sequence[float] | np.ndarray) -> Interval | None:
    """Return the mean of the finite values (n,) of a measure with its 95 % interval; None if none
    is finite. The name "" is that of differences, which may be below 0.
    """
    finite = np.asarray(values)[np.isfinite(values)]
    if not len(finite):
        return None
    if name == SUCCESS_RATE:
        return clopper_pearson(int(finite.sum()), len(finite))
    return mean_of(finite, least=0.0 if name else -np.inf)
