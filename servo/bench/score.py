"""The table of a benchmark: scores with confidence intervals over its worlds (random scenarios),
ranks, and effects of factors such as the light.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from servo.bench.benchmark import World, condition_of
from servo.bench.contestant import FROZEN, NULL, PERFECT
from servo.bench.row import Row
from servo.mistake import Mistake
from servo.study.run import grouped_by
from sim.types import Array
from tracking.statistics.comparisons import Interval, holm, in_percent, mean_of

ONE_SCALE = ("loop-v1",)
"""Benchmarks whose points have one scale for all conditions; later ones have one for each."""
SURE = 0.05
"""Largest p-value, after Holm's correction, of contestants with different ranks."""
SHARE = (0.0, 1.0)
"""Bounds of a share."""
HALF = 0.5
"""A tracker is fast enough while half of the worlds are held."""
FEWEST_CONTESTANTS = 3
"""Fewest contestants from which the difficulty of worlds is computed."""
FEWEST_WORLDS = 5
"""Fewest worlds of a level whose effect is computed."""
RELATED = 0.2
"""Item-rest correlation above which a world agrees with the others on who is better."""
SPLITS = 100
"""Number of random splits of the worlds into halves."""
POWER = 1.96 + 0.84
"""Sum of the normal quantiles of a two-sided test at 5 % and of a power of 80 %."""
LIGHT = ("light.azimuth_deg", "light.elevation_deg")
"""Settings of the lamp that benchmarks of trackers draw in all conditions; `effects` splits the
worlds into thirds by each."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A contestant's place in the table of a benchmark: its results, its score and the share of
    worlds (random scenarios) in which it held the target or arrived, both with 95 % intervals, the
    best and worst rank that it may have (`first`, `last`), the share of worlds in which it is
    better than the next contestant (`beats_next`), its points by world, and the longest time for a
    picture at which it still holds at least half of the worlds and more than the tracker `frozen`
    (`slowest`) [ms], None without one.
    """

    row: Row
    score: Interval
    """From 0, where the camera stands still, to 100."""
    held: Interval
    """Share of the worlds in which the target was held, or reached."""
    first: int
    last: int
    """Best and worst rank that the contestant may have: after all that are significantly better,
    and before all that are significantly worse."""
    beats_next: float | None
    """Share of worlds in which the contestant is better than the next one; ties count half. None
    for the last contestant."""
    points: dict[str, float]
    """Points in each world, by its key; the score is their mean."""
    slowest: float | None
    """The longest time for a picture [ms] up to which at least half of the worlds are held, and
    more of them than `frozen` holds if it is in the table; None without such a time.
    """

    @property
    def name(self) -> str:
        """Name of the contestant."""
        return self.row.contestant

    def mean_in(self, condition: str) -> float:
        """Return the contestant's mean points in the worlds (random scenarios) of one condition;
        nan if it has no result there. A camera that stands still has 0; a tracker that knows the
        target's true state, or a law that always arrives, has 100 (in the first benchmark, loop-v1,
        only on average over all conditions).
        """
        of = [p for key, p in self.points.items() if condition_of(key) == condition]
        return float(np.mean(of)) if of else float("nan")


def points_of(row: Row, null: Row, perfect: Row | None) -> dict[str, float]:
    """Return the points of a contestant by name of the world (random scenario); their mean is its
    score.

    The points in a world are 100 (own - least) / (mean of top - mean of least). Here own, least and
    top are the results (0..1) of `row`, of `null`, whose camera stands still, and of `perfect` (1
    without it) in the world. Means are over the worlds of its condition in which all of them have a
    result; in the first benchmark, loop-v1, over those of all conditions.

    Raises:
        Mistake: There is no world in which all of them have a result.
    """
    rows = [of for of in (row, null, perfect) if of is not None]
    worlds = sorted(set(row.worlds).intersection(*(of.worlds for of in rows)))
    if not worlds:
        all_of = ", ".join(f"'{of.contestant}'" for of in rows)
        raise Mistake(
            f"there is no world in which each of {all_of} has a result: run the benchmark again "
            "for these contestants"
        )
    whole = row.benchmark in ONE_SCALE
    groups = grouped_by(worlds, lambda key: "" if whole else condition_of(key))
    found = dict[str, float]()
    for keys in groups.values():
        own, least = (np.array([of.worlds[key].area for key in keys]) for of in (row, null))
        top = [1.0 if perfect is None else perfect.worlds[key].area for key in keys]
        points = 100 * (own - least) / float(np.mean(top) - least.mean())
        found |= dict(zip(keys, points.tolist(), strict=True))
    return found


def _score_of(points: Mapping[str, float], *, whole: bool, bounds: tuple[float, ...]) -> Interval:
    """Return the mean of the points in all worlds, with its 95 % interval. Without bounds, as of
    points that may be above 100, the interval is stratified: worlds vary within their conditions,
    and the conditions are the same for everybody (Cochran, Sampling techniques, 1977, section 5.4).

    Args:
        points: Points by the name of a world.
        whole: Whether the interval ignores the conditions.
        bounds: Least and most possible points, divided by 100; empty: none.
    """
    values = np.array(list(points.values())) / 100
    conditions = {condition_of(key) for key in points}
    if not (whole or bounds) and len(points) > len(conditions):
        groups = grouped_by(points, condition_of)
        means = {name: np.mean([points[key] for key in keys]) for name, keys in groups.items()}
        within = values - np.array([means[condition_of(key)] for key in points]) / 100
        # Each condition's mean costs a degree of freedom.
        freedom = (len(points) - 1) / (len(points) - len(conditions))
        values = values.mean() + within * np.sqrt(freedom)
    return in_percent(mean_of(values, *bounds))


def standings(rows: Sequence[Row]) -> list[Standing]:
    """Return the places of contestants in a benchmark's table, the highest score first.

    Ranks are intervals: each pair of contestants is compared in their common worlds (random
    scenarios) by a paired t-test, with Holm's correction for all pairs. The test compares means, as
    the score does: signed ranks would prefer a contestant that is a little better in most worlds
    and loses the target in some.

    Args:
        rows: Results of the contestants, and of the references "still" and, if the benchmark has
            it, "truth", which define the scores 0 and 100 and get no place.

    Raises:
        Mistake: The results of "still" are missing, or there is no world in which a contestant and
            all references have a result.
    """
    by_name = {row.contestant: row for row in rows}
    if NULL not in by_name:
        raise Mistake(
            f"the results of '{NULL}', whose camera stands still and has the score 0, are "
            f"missing: run the benchmark for '{NULL}' too"
        )
    ends = by_name[NULL], by_name.get(PERFECT)
    compared = {row.contestant: row for row in rows if row.contestant not in (NULL, PERFECT)}
    points = {name: points_of(row, *ends) for name, row in compared.items()}
    order = sorted(points, key=lambda name: -float(np.mean(list(points[name].values()))))
    bounds = () if PERFECT in by_name else SHARE  # what is better than `perfect` has more than 100
    better = _better(points, order)
    after = [*order[1:], None]
    return [
        Standing(
            row=compared[name],
            score=_score_of(
                points[name], whole=compared[name].benchmark in ONE_SCALE, bounds=bounds
            ),
            held=mean_of(np.array([float(w.held) for w in compared[name].worlds.values()]), *SHARE),
            first=1 + sum((other, name) in better for other in order),
            last=len(order) - sum((name, other) in better for other in order),
            beats_next=None if following is None else _share(points[name], points[following]),
            points=points[name],
            slowest=_slowest(compared[name], compared.get(FROZEN)),
        )
        for name, following in zip(order, after, strict=True)
    ]


def _share(points: dict[str, float], others: dict[str, float]) -> float:
    """Return the share of worlds in which points are above another contestant's; ties count
    half.
    """
    return float(np.mean(np.heaviside(_gaps(points, others), 0.5)))


def _slowest(row: Row, frozen: Row | None) -> float | None:
    longest = None
    for ms in sorted(row.slow, key=float):
        if row.slow[ms] < HALF or (frozen and row.slow[ms] <= frozen.slow.get(ms, 0.0)):
            break
        longest = float(ms)
    return longest


def _better(
    points: Mapping[str, Mapping[str, float]], order: Sequence[str]
) -> set[tuple[str, str]]:
    """Return the pairs (better, worse) of contestants that differ significantly.

    Args:
        points: Points by contestant and world.
        order: Names of the contestants, that with the best mean first.
    """
    pairs = [(a, b) for i, a in enumerate(order) for b in order[i + 1 :]]
    chances = np.array([_chance(_gaps(points[a], points[b])) for a, b in pairs])
    return {pair for pair, p in zip(pairs, holm(chances), strict=True) if p < SURE}


def _chance(gaps: Array) -> float:
    """Return the two-sided p-value of Student's test that the mean of the differences (n,) is 0."""
    from scipy.special import stdtr  # takes a second

    spread = float(gaps.std(ddof=1)) if len(gaps) > 1 else np.inf
    if not gaps.any() or spread == np.inf:
        return 1.0
    if spread == 0.0:  # one is better by the same amount everywhere
        return 0.0
    t = abs(float(gaps.mean())) * np.sqrt(len(gaps)) / spread
    return float(2 * stdtr(len(gaps) - 1, -t))


def _gaps(first: Mapping[str, float], second: Mapping[str, float]) -> Array:
    """Return the differences (n,) between two contestants' points in their common worlds."""
    return np.array([first[key] - second[key] for key in sorted(first.keys() & second.keys())])


@dataclass(frozen=True, slots=True)
class Effect:
    """The mean points of all contestants in the worlds (random scenarios) at one level of a factor,
    such as one kind of ground, with a 95 % interval over these worlds.
    """

    factor: str
    level: str
    points: Interval
    """Mean over the worlds of this level, of the mean over the contestants."""


def effects(worlds: Sequence[World], table: Sequence[Standing]) -> list[Effect]:
    """Return the mean points, with a 95 % interval, over the worlds (random scenarios) at each
    level of each factor, and over each third of the worlds in order of the lamp's azimuth and of
    its elevation.

    The points in a world are the mean of all contestants in `table` that have a result there. A
    level with fewer than five such worlds is left out.

    Args:
        worlds: The worlds of the benchmark.
        table: Places of the contestants.
    """
    found = list[Effect]()
    for (factor, level), keys in _levels(worlds).items():
        means = [
            float(np.mean(of))
            for key in keys
            if (of := [s.points[key] for s in table if key in s.points])
        ]
        if len(means) >= FEWEST_WORLDS:
            found.append(Effect(factor, level, mean_of(np.array(means))))
    return found


def _levels(worlds: Sequence[World]) -> dict[tuple[str, str], list[str]]:
    """Return the names of the worlds at each level, by (factor, level). The lamp's azimuth and
    elevation count as factors with three levels of equally many worlds, such as "30 to 50".
    """
    chosen = sorted({level for world in worlds for level in world.levels.items()})
    found = {(f, of): [w.key for w in worlds if w.levels.get(f) == of] for f, of in chosen}
    for name in LIGHT:
        lit = [w for w in worlds if name in w.settings]
        lit.sort(key=lambda w: float(str(w.settings[name])))
        for part in np.array_split(np.arange(len(lit)), 3):
            if len(part):
                ends = (lit[i].settings[name] for i in (part[0], part[-1]))
                level = " to ".join(f"{end:.0f}" for end in ends)
                found[name, level] = [lit[i].key for i in part]
    return found


@dataclass(frozen=True, slots=True)
class Difficulty:
    """Numbers of worlds (random scenarios) that do not distinguish contestants, because none of
    them held the target (or arrived) there (`nobody`), or all did (`everybody`); and the number of
    all worlds in which each of them has a result. The tracker `frozen`, which does not use
    pictures, does not count as a contestant.
    """

    nobody: int
    """Number of worlds that no contestant held."""
    everybody: int
    """Number of worlds that every contestant but `frozen` held."""
    worlds: int
    """Number of worlds in which all contestants have a result."""

    @staticmethod
    def of(table: Sequence[Standing]) -> "Difficulty | None":
        """Count the worlds (random scenarios) in which none, and in which all, of the contestants
        in a table held the target or arrived. The tracker `frozen` is left out; return None if
        fewer than three contestants remain.
        """
        rows = [standing.row.worlds for standing in table if standing.name != FROZEN]
        if len(rows) < FEWEST_CONTESTANTS:
            return None
        keys = set[str]().union(*rows).intersection(*rows)
        held = [sum(row[key].held for row in rows) for key in keys]
        return Difficulty(held.count(0), held.count(len(rows)), len(held))


@dataclass(frozen=True, slots=True)
class Discrimination:
    """How well the worlds (random scenarios) of a benchmark tell its contestants apart.

    `agreeing` is the share (0 to 1) of worlds whose item-rest correlation is above 0.2: the
    correlation, over the contestants, of the points in the world with the mean points in all other
    worlds; worlds in which all contestants have equal points are left out. `halves` is the
    split-half reliability: the mean correlation of the contestants' scores in two random halves of
    the worlds, for the full number of worlds (Spearman and Brown, 1910). `needed` is the number of
    worlds in which a paired test at 5 % finds the difference between the first two contestants with
    a probability of 80 %; inf if their means are equal.
    """

    agreeing: float
    halves: float
    needed: float

    @staticmethod
    def of(table: Sequence[Standing]) -> "Discrimination | None":
        """Return how well the worlds tell apart the contestants in a table (the best one first),
        without the tracker `frozen`; None for fewer than three contestants, or if no world has an
        item-rest correlation, as where all contestants have equal points in each world.
        """
        rows = [standing.points for standing in table if standing.name != FROZEN]
        if len(rows) < FEWEST_CONTESTANTS:
            return None
        keys = sorted(set(rows[0]).intersection(*rows))
        points = np.array([[row[key] for key in keys] for row in rows])
        related = item_rest(points)
        related = related[np.isfinite(related)]
        if not len(related):
            return None
        rng = np.random.default_rng(0)  # the same splits each time
        splits = [rng.permuted(np.arange(len(keys)) % 2 == 0) for _ in range(SPLITS)]
        means = [(points[:, half].mean(1), points[:, ~half].mean(1)) for half in splits]
        r = float(np.mean([np.corrcoef(*each)[0, 1] for each in means]))
        gaps = points[0] - points[1]
        gap, spread = float(gaps.mean()), float(gaps.std(ddof=1))
        needed = (POWER * spread / gap) ** 2 if gap else np.inf
        return Discrimination(float(np.mean(related > RELATED)), 2 * r / (1 + r), needed)


def item_rest(points: Array) -> Array:
    """Return, for each world, the correlation (n,) over contestants of their points (m, n) there
    with the mean of their points in all other worlds; nan if either is constant.
    """
    rest = points.sum(axis=1, keepdims=True) - points  # correlates as the mean does
    constant = (np.ptp(points, axis=0) == 0) | (np.ptp(rest, axis=0) == 0)
    own, rest = points - points.mean(axis=0), rest - rest.mean(axis=0)
    length = np.sqrt((own**2).sum(axis=0) * (rest**2).sum(axis=0))
    return np.where(constant, np.nan, (own * rest).sum(axis=0) / np.where(constant, 1, length))


def by_size(row: Row, worlds: Sequence[World], condition: str, parts: int) -> list[float]:
    """Return the shares (0 to 1) of worlds (random scenarios) of a condition in which a contestant
    held the target or arrived, by size of the task.

    Args:
        row: Results of the contestant; worlds without a result are left out.
        worlds: The worlds; those of other conditions are ignored.
        condition: Name of the condition.
        parts: Number of groups, of about equal number of worlds, into which they are split by size.

    Returns:
        The share in each group, that with the smallest sizes first; nan for an empty group.
    """
    own = sorted(
        (w for w in worlds if w.condition == condition and w.key in row.worlds),
        key=lambda w: w.size,
    )
    split = np.array_split(np.array([float(row.worlds[w.key].held) for w in own]), parts)
    return [float(part.mean()) if len(part) else float("nan") for part in split]
