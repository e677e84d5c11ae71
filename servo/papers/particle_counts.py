"""Claims of the KAMS paper about how many particles each filter needs in clutter."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from servo.papers.claim import FRESH, Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.drawing import lines
from servo.papers.experiments import contender, sequence_jobs
from servo.papers.groups import column, group, words
from servo.papers.kams_paper import clutter
from servo.papers.tuning import AS_PUBLISHED, TUNED
from servo.study.job import Job
from sim.types import Array
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import greater

KINDS = ("kams", "annealed", "hybrid", "condensation")
COUNTS = (12, 25, 50, 100, 200, 400)
LEVEL = "e"
SEEDS = 32
ENOUGH = 0.9
"""Share of the sequences that must be completed."""
DRAWS = 2000
"""Number of draws of the sequences behind an interval."""
FEWER = 4.0
"""Least ratio that is 75 % fewer."""


def _label(kind: str, count: int) -> str:
    return f"{kind}-{count}-particles"


def _jobs(effort: Effort) -> Sequence[Job]:
    trackers = [
        contender(TUNED[k].kind, "paper", _label(k, n), **AS_PUBLISHED[k] | {"particles": n})
        for k in KINDS
        for n in COUNTS
    ]
    return sequence_jobs(trackers, [clutter(LEVEL)], effort.seeds(SEEDS))


def needed(shares: Array) -> Array:
    """Return how many particles reach `ENOUGH`, between the counts by the logarithm.

    Args:
        shares: Shares of completed sequences (counts, n).

    Returns:
        Particles (n,); twice the largest count where they do not reach it.
    """
    logs = np.log2([*COUNTS, 2 * COUNTS[-1]])
    grown = np.vstack([np.maximum.accumulate(shares), np.full(shares.shape[1], 1.0)])
    at = np.argmax(grown >= ENOUGH, axis=0)
    i = np.arange(len(at))
    before = np.maximum(at - 1, 0)
    rise = np.maximum(grown[at, i] - grown[before, i], 1e-9)
    part = np.where((at == 0) | (at == len(COUNTS)), 1.0, (ENOUGH - grown[before, i]) / rise)
    return 2.0 ** (logs[before] + part * (logs[at] - logs[before]))


def _judge(rivals: Sequence[str], bound: float, evidence: Evidence) -> Verdict:
    completed = {
        k: np.array(
            [column(group(evidence.records, tracker=_label(k, n)), "completed") for n in COUNTS]
        )
        for k in KINDS
    }
    size = completed["kams"].shape[1]
    drawn = np.random.default_rng(0).integers(0, size, (DRAWS, size))
    # All sequences first, then the draws, which are the same for all trackers.
    which = np.vstack([np.arange(size), drawn])
    found = {k: needed(c[:, which].mean(axis=2)) for k, c in completed.items()}
    ratios = {k: _interval(found[k] / found["kams"]) for k in KINDS}
    nearest = min(rivals, key=lambda k: ratios[k].low)
    shares = {k: 100 * c.mean(axis=1) for k, c in completed.items()}
    rows = [
        [k, words(_interval(found[k])), words(ratios[k]), *(f"{s:.0f} %" for s in shares[k])]
        for k in KINDS
    ]
    return Verdict(
        every(greater(ratios[k], bound) for k in rivals),
        ratios[nearest],
        "times KAMS's particles",
        size,
        f"least ratio of particles needed: {nearest} ({2 * COUNTS[-1]} stands for more than "
        f"{COUNTS[-1]})",
        [["tracker", f"particles for {ENOUGH:.0%}", "over KAMS's", *map(str, COUNTS)], *rows],
        lines(
            "completion by number of particles",
            "particles",
            "sequences completed [%]",
            {kind: (COUNTS, share) for kind, share in shares.items()},
            top=102,
            marker="o",
            logarithmic="x",
        ),
    )


def _interval(values: Array) -> Interval:
    """Return the first value with the percentile interval of the others, which were drawn."""
    low, high = np.percentile(values[1:], [2.5, 97.5])
    return Interval(float(values[0]), float(low), float(high))


def _claim(name: str, says: str, rivals: Sequence[str], bound: float) -> Claim:
    rule = Rule(
        f"particles with which {ENOUGH:.0%} of the sequences are completed, over KAMS's",
        f"the paper's presets with {', '.join(map(str, COUNTS))} particles",
        f"{SEEDS} painted sequences of level {LEVEL}, seeds from {FRESH} on",
        "none",
        f"95 % percentile interval of {DRAWS} draws of the sequences",
        f"above {bound:g} for {', '.join(rivals)}",
    )
    return Claim(name, says, rule, partial(_judge, rivals, bound), _jobs)


CLAIMS = (
    _claim("P0-4", "KAMS needs the fewest particles", KINDS[1:], 1.0),
    _claim("P0-7", "KAMS needs fewer particles than the hybrid", ("hybrid",), 1.0),
    _claim("P0-8", "KAMS needs 75 % fewer particles", KINDS[1:], FEWER),
)
