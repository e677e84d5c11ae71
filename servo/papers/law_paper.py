"""Claims of papers about control laws of visual servoing, tested in new worlds (random scenarios)
of the benchmark servo-v1, and some of them again in those of servo-v2, with a wrong model of the
camera and late commands.

F. Chaumette, Potential problems of stability and convergence in image-based and position-based
visual servoing, 1998. N. R. Gans, P. I. Corke, S. A. Hutchinson, Performance tests of partitioned
approaches to visual servo control, 2002, and with position-based servoing, 2003.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from servo.bench.benchmark import Band, load
from servo.bench.contestant import contestants
from servo.bench.world_run import CONTESTANT, WORLD, jobs_of
from servo.bench.world_score import world_score
from servo.papers.claim import FRESH, Claim, Effort, Evidence, Rule, Verdict
from servo.papers.summaries import column, group, intervals, mean, words
from servo.study.run import Job, Record
from sim.types import Array
from tracking.statistics.comparisons import (
    Interval,
    difference_of_shares,
    in_percent,
    mean_of,
    mean_percent,
)
from tracking.statistics.verdicts import Finding, greater, not_worse

FIRST = "servo-v1"
HARDER = "servo-v2"
ERRORS = {
    FIRST: "servo-v1 as it is frozen; corners are given, seven errors",
    HARDER: "servo-v2 as it is frozen; corners are given, a wrong model and late commands",
}
"""The worlds of each benchmark in words, for rules."""
RETREAT = 0.1
"""Least mean retreat that counts [m]; a turn of 90 deg alone gives 0.25 m."""
MORE = 20.0
"""Least difference of shares that counts [% of the worlds]."""
ALIKE = 15.0
"""Largest difference of shares that counts as equally good [% of the worlds]."""
POINTS = "points"
POLAR = "polar"
POSE = "pose c*Mc"
PARTITIONED = "partitioned"
CENTRED = "pose cMo"


def _jobs(where: str, condition: str, laws: Sequence[str], effort: Effort) -> Sequence[Job]:
    """Return the runs of some control laws in worlds (random scenarios) of a condition of a
    benchmark (`where`). The worlds are sealed ones, with the first seed as their public value (in a
    quick check 100000, and only one world).
    """
    benchmark = load(where)
    first = FRESH if effort.first is None else effort.first
    band = Band("sealed", str(effort.seeds(1)[0] if effort.quick else first), "papers")
    chosen = next(c for c in benchmark.conditions if c.name == condition)
    worlds = benchmark.worlds_of(chosen, band)[: 1 if effort.quick else None]
    jobs = jobs_of(benchmark, contestants(benchmark, laws), worlds)
    return [
        replace(job, name=f"laws/{job.settings[CONTESTANT]}-{job.settings[WORLD]}-{job.seed}")
        for job in jobs
    ]


def _arrived(records: Sequence[Record]) -> Array:
    """Return 1 for each run (n,) whose camera arrived at its goal, with the target always in view,
    else 0.
    """
    score = load(FIRST).score  # also that of servo-v2
    return np.array([world_score(score, record).area for record in records])


def _left(records: Sequence[Record]) -> Array:
    """Return 1 for each run (n,) in which a corner of the target left the picture, else 0."""
    return (column(records, "out_of_view_pct") > 0).astype(float)


def _retreat(laws: Sequence[str], evidence: Evidence) -> Verdict:
    """Return the verdict on the claim P3-1 that the camera's retreat from the target with the first
    law (image points) is more than 0.1 m longer than with the second one (polar coordinates).
    """
    runs = _runs(evidence, laws)
    found = {law: mean_of(column(of, "retreat_m")) for law, of in runs.items()}
    own, other = (column(of, "retreat_m") for of in runs.values())
    gap = mean_of(own - other)
    return _verdict(greater(gap, RETREAT), gap, "m farther", "retreat [m]", found, runs)


def _compared(
    share: Callable[[Sequence[Record]], Array],
    judge: Callable[[Interval], Finding],
    about: str,
    laws: Sequence[str],
    evidence: Evidence,
) -> Verdict:
    """Return the verdict on the difference of two shares of worlds (random scenarios): that of the
    first control law less that of the second.

    Args:
        share: Function that returns 1 or 0 for each run (n,).
        judge: Function that returns the finding on the difference [%].
        about: Name of the share in text and figure.
        laws: Names of the two laws.
        evidence: Results of the runs.
    """
    runs = _runs(evidence, laws)
    flags = {law: share(of) for law, of in runs.items()}
    gap = in_percent(difference_of_shares(*flags.values()))
    found = {law: mean_percent(of) for law, of in flags.items()}
    return _verdict(judge(gap), gap, "% of the worlds", f"{about} [%]", found, runs)


def _runs(evidence: Evidence, laws: Sequence[str]) -> dict[str, list[Record]]:
    """Return the records of each of some control laws, by name of the law."""
    return {law: group(evidence.records, **{CONTESTANT: law}) for law in laws}


def _verdict(
    finding: Finding,
    effect: Interval,
    unit: str,
    measure: str,
    found: dict[str, Interval],
    runs: dict[str, list[Record]],
) -> Verdict:
    """Return a verdict with a table and a figure of two control laws.

    Args:
        finding: The finding.
        effect: Difference of the measure between the two laws, with its interval.
        unit: Unit of the effect.
        measure: Name of the measure, with its unit.
        found: Mean of the measure, by law.
        runs: Records, by law.
    """
    rows = [
        [
            law,
            words(mean_percent(_arrived(of)), "%"),
            words(mean_percent(_left(of)), "%"),
            mean(of, "retreat_m", "m"),
            mean(of, "camera_path_m", "m"),
        ]
        for law, of in runs.items()
    ]
    return Verdict(
        finding,
        effect,
        unit,
        effect.units,
        f"{measure}: {', '.join(f'{law} {words(of)}' for law, of in found.items())}",
        [["law", "arrived", "left the picture", "retreat", "camera path"], *rows],
        intervals("worlds of the benchmark", measure, found),
    )


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A claim about two control laws in worlds (random scenarios) of a condition; the texts are
    those of `Claim` and `Rule`.
    """

    name: str
    says: str
    measure: str
    condition: str
    margin: str
    holds: str
    laws: tuple[str, str]
    judge: Callable[[Sequence[str], Evidence], Verdict]
    """Function of the names of the two laws and of the results."""
    again: bool = False
    """True if the claim is also judged in worlds with a wrong camera model and late commands."""

    def claim(self) -> Claim:
        """Return the claim in worlds of the first benchmark of laws, servo-v1."""
        return self._in(FIRST, self.name, self.says)

    def harder(self) -> Claim:
        """Return the same claim, by the same rule, in worlds of servo-v2."""
        says = f"with a wrong model of the camera and late commands: {self.says}"
        return self._in(HARDER, f"{self.name}b", says)

    def _in(self, where: str, name: str, says: str) -> Claim:
        """Return the claim in worlds of a benchmark, under a name of its own."""
        rule = Rule(
            self.measure,
            ERRORS[where],
            f"{load(where).worlds} worlds of `{self.condition}`, sealed with the first seed "
            f"({FRESH})",
            self.margin,
            "95 % interval over worlds",
            self.holds,
        )
        judge = partial(self.judge, self.laws)
        return Claim(name, says, rule, judge, partial(_jobs, where, self.condition, self.laws))


COMPARISONS = (
    _Comparison(
        "P3-1",
        "a turn about the optical axis drives the camera away with image points (Chaumette, 1998)",
        "largest distance beyond start and goal, less that with polar coordinates",
        "turn",
        f"{RETREAT:g} m",
        f"above {RETREAT:g} m",
        (POINTS, POLAR),
        _retreat,
        again=True,
    ),
    _Comparison(
        "P3-2",
        "large turns fail with image points and not where the turn has a feature of its own "
        "(Gans, Hutchinson, Corke, 2003)",
        "worlds reached with polar coordinates, less those with image points",
        "turn",
        f"{MORE:g} %",
        f"above {MORE:g} %",
        (POLAR, POINTS),
        partial(_compared, _arrived, lambda gap: greater(gap, MORE), "arrived"),
        again=True,
    ),
    _Comparison(
        "P3-3",
        "along the optical axis image points do as well as the pose (Gans, Hutchinson, Corke)",
        "worlds reached with the pose, less those with image points",
        "along",
        f"{ALIKE:g} %",
        f"below {ALIKE:g} %",
        (POSE, POINTS),
        partial(_compared, _arrived, lambda gap: not_worse(gap, ALIKE), "arrived"),
    ),
    _Comparison(
        "P3-4",
        "servoing on the pose loses the target from its picture, where servoing on its centre and "
        "the pose of the target does not (Chaumette, 1998)",
        "worlds in which a corner left the picture with c*Mc, less those with cMo",
        "general",
        "0",
        "above 0",
        (POSE, CENTRED),
        partial(_compared, _left, lambda gap: greater(gap, 0.0), "left"),
        again=True,
    ),
    _Comparison(
        "P3-5",
        "partitioning costs nothing where image points do well: a turn about an axis in the "
        "picture (Gans, Corke, Hutchinson, 2002)",
        "worlds reached with image points, less those with the partitioned law",
        "tilt",
        f"{ALIKE:g} %",
        f"below {ALIKE:g} %",
        (POINTS, PARTITIONED),
        partial(_compared, _arrived, lambda gap: not_worse(gap, ALIKE), "arrived"),
    ),
    _Comparison(
        "P3-6",
        "a partitioned law manages general motions at which image points fail (Gans, Corke, "
        "Hutchinson, 2002)",
        "worlds reached with the partitioned law, less those with image points",
        "general",
        f"{MORE:g} %",
        f"above {MORE:g} %",
        (PARTITIONED, POINTS),
        partial(_compared, _arrived, lambda gap: greater(gap, MORE), "arrived"),
        again=True,
    ),
)
CLAIMS = (
    *(one.claim() for one in COMPARISONS),
    *(one.harder() for one in COMPARISONS if one.again),
)
