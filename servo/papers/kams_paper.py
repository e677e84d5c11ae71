"""Claims of the KAMS paper (Naeem, Pridmore, Mills) about sequences in clutter that trackers
complete, and how they are judged.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from servo.papers.claim import WORDS, Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import contender, generated, sequence_jobs
from servo.papers.summaries import (
    column,
    completed,
    completed_more,
    done,
    dots,
    group,
    intervals,
    mean,
    reads,
    words,
)
from servo.papers.tuning import AS_PUBLISHED, LEVELS, published, tuned
from servo.study.run import Job, Record
from servo.study.sequence_run import Contender, Generated, Recorded
from tracking.statistics.comparisons import Interval, McNemar, holm
from tracking.statistics.verdicts import Finding, greater

EASY = "abcd"
"""Levels of the paper's sequences."""
SEEDS = 16
SEEDS_ERROR = 10
RIVALS = ("condensation", "mean_shift", "annealed", "hybrid", "sok")
OF_200 = ("condensation", "annealed", "hybrid")
PAPER_Z = {
    "condensation": "2.91",
    "mean_shift": "5.13",
    "annealed": "3.80",
    "hybrid": "4.83",
    "sok": "3.59",
}
"""z of KAMS against each tracker, from table 1 of the KAMS paper."""
PAPER_PX = (6.9, 18.2, 14.7, 17.3)
"""KAMS's mean errors on levels a to d in the KAMS paper [px]."""
MARGIN = 5.0
"""Largest difference of completion that still counts as "not fewer" [%]."""
SIGNIFICANT = 0.05
"""Largest p value of a difference."""
LEAST_D = 8
"""Least number of sequences of level d that must be completed."""
FEW_LAYERS = 3


def clutter(level: str) -> Generated:
    """Return the painted sequences in clutter of one level, from "a" to "h"."""
    return generated("clutter", level=level)


def _painted(trackers: Sequence[Contender], effort: Effort) -> Sequence[Job]:
    """Return the runs of trackers on painted sequences of the hard levels, and on real sequences if
    the options name a folder of them.
    """
    real = [] if effort.sequences is None else Recorded.all_in(effort.sequences)
    fresh = sequence_jobs(trackers, [clutter(level) for level in LEVELS], effort.seeds(SEEDS))
    return [*fresh, *sequence_jobs(trackers, real, range(1))]


def _published(kinds: Sequence[str], effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS and other kinds with their papers' settings."""
    return _painted([published(k) for k in ("kams", *kinds)], effort)


def _equal(effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS and its rivals with their own best settings."""
    return _painted([tuned(k) for k in ("kams", *RIVALS)], effort)


def _layers(effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS with few layers, and of annealing."""
    few = contender(
        "kams", "paper", f"kams-{FEW_LAYERS}-layers", layers=FEW_LAYERS, **AS_PUBLISHED["kams"]
    )
    return _painted([few, published("annealed")], effort)


Decide = Callable[[Interval, McNemar, float], Finding]
"""Function that returns the finding of a comparison, given the difference of completed shares (KAMS
less the other tracker) [%], McNemar's test on completion, and its p value after Holm's correction.
"""


def _significantly(_: Interval, test: McNemar, p: float) -> Finding:
    """Return the finding of McNemar's test: undecided unless the difference is significant."""
    if p >= SIGNIFICANT:
        return Finding.UNDECIDED
    return Finding.HOLDS if test.wins > test.losses else Finding.DOES_NOT_HOLD


def _judge_pairs(decide: Decide, evidence: Evidence) -> Verdict:
    """Return the verdict on KAMS, whose runs come first, against each other tracker; `decide`
    returns the finding of each comparison.
    """
    runs = evidence.trackers
    first, *others = runs
    ours = runs[first]
    gains = {o: completed_more(ours, runs[o]) for o in others}
    tests = {o: _mcnemar(ours, runs[o], "completed") for o in others}
    corrected = dict(zip(others, holm(np.array([t.p for t in tests.values()])), strict=True))
    findings = {o: decide(gains[o], tests[o], corrected[o]) for o in others}
    nearest = min(others, key=lambda o: gains[o].value)
    head = [
        "",
        "done",
        "KAMS more [%]",
        "won-lost",
        "p (Holm)",
        "z of frames",
        "paper",
        "reads",
        "",
    ]
    rows = [
        [
            o,
            done(runs[o]),
            words(gains[o]),
            f"{tests[o].wins}-{tests[o].losses}",
            f"{corrected[o]:.2g}",
            f"{_mcnemar(ours, runs[o], 'frames_until_loss').z:.2f}",
            PAPER_Z.get(o.rpartition("-")[0], ""),
            reads(runs[o]),
            WORDS[findings[o]],
        ]
        for o in others
    ]
    not_shown = [o for o in others if findings[o] is not Finding.HOLDS]
    where = f"against {', '.join(not_shown)} it is open or false" if not_shown else "against all"
    shares = {o: completed(found) for o, found in runs.items()}
    return Verdict(
        every(findings.values()),
        gains[nearest],
        "% of the sequences",
        len(ours),
        f"{first} completes {done(ours)}; {where}; the effect is that against {nearest}",
        [head, [first, done(ours), "", "", "", "", "", reads(ours), ""], *rows],
        intervals("who completes", "sequences completed [%]", shares),
    )


def _mcnemar(first: Sequence[Record], second: Sequence[Record], measure: str) -> McNemar:
    """Compare a measure of two trackers on the same sequences; the higher value wins."""
    return McNemar.of(column(first, measure), column(second, measure))


def _errors(effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS with published and tuned settings on the paper's levels."""
    trackers = [published("kams"), tuned("kams")]
    return sequence_jobs(trackers, [clutter(c) for c in EASY], effort.seeds(SEEDS_ERROR))


def _judge_errors(evidence: Evidence) -> Verdict:
    """Return the verdict on the sequences that KAMS completes at each level."""
    by_level = {
        label: {level: group(found, family=f"clutter-{level}") for level in EASY}
        for label, found in evidence.trackers.items()
    }
    head = ["settings", *(f"{level}: mean error [px], completed" for level in EASY)]
    rows = [
        [label, *(f"{mean(runs, 'mean_error_px')}, {done(runs)}" for runs in levels.values())]
        for label, levels in by_level.items()
    ]
    errors = {
        f"{level}-{label}": column(levels[level], "mean_error_px")
        for level in EASY
        for label, levels in by_level.items()
    }
    ours = by_level[published("kams").label]
    counts = [int(column(runs, "completed").sum()) for runs in ours.values()]
    kept = counts[:-1] == [len(ours[level]) for level in EASY[:-1]]
    enough = counts[-1] >= LEAST_D / SEEDS_ERROR * len(ours[EASY[-1]])
    every_level = [r for runs in ours.values() for r in runs]
    return Verdict(
        Finding.HOLDS if kept and enough else Finding.DOES_NOT_HOLD,
        completed(every_level),
        "% of the sequences",
        len(every_level),
        "completed with published settings: "
        + ", ".join(f"{level} {done(runs)}" for level, runs in ours.items()),
        [head, ["the paper's result", *(f"{px:g}" for px in PAPER_PX)], *rows],
        dots("mean error", "mean error [px]", errors, "y"),
    )


PUBLISHED = (
    "the paper's numbers: KAMS 50 particles in 5 layers, the other filters 200, the hybrid with "
    "constant velocity; noise, which it does not give: the target's size"
)
UNITS = f"{SEEDS} painted sequences of each of the levels {', '.join(LEVELS)}, seeds from 1000 on"
SHARE = "share of sequences completed (never five frames in a row off by the target's size)"
PAIRED = "95 % interval of the mean paired difference"
CLAIMS = (
    Claim(
        "P0-1a",
        "KAMS tracks for longer than each of five others (McNemar, 36 sequences, z from "
        "2.91 to 5.13), here with the paper's numbers of particles",
        Rule(
            SHARE,
            PUBLISHED,
            UNITS,
            f"{MARGIN:g} %",
            PAIRED,
            "not fewer completed than by each of five",
        ),
        partial(_judge_pairs, lambda gain, *_: greater(gain, -MARGIN)),
        partial(_published, RIVALS),
    ),
    Claim(
        "P0-1b",
        "the same at equal compute",
        Rule(
            SHARE,
            "each with its own best settings (tuning.json), and as many histograms a "
            "frame as KAMS, as far as it can read them",
            UNITS,
            "none",
            "McNemar's exact test on completion, Holm over five",
            f"p < {SIGNIFICANT:g} against each of five",
        ),
        partial(_judge_pairs, _significantly),
        _equal,
    ),
    Claim(
        "P0-2",
        "KAMS completes levels a to d with mean errors of 6.9, 18.2, 14.7, 17.3 px",
        Rule(
            "sequences completed at each level, and mean error",
            "published, and own best",
            f"{SEEDS_ERROR} painted sequences a level, seeds from 1000 on",
            "none",
            "count",
            f"published: all of a, b and c, and at least {LEAST_D} of {SEEDS_ERROR} of d",
        ),
        _judge_errors,
        _errors,
    ),
    Claim(
        "P0-5",
        "KAMS follows with 50 particles where others fail with 200",
        Rule(
            SHARE,
            PUBLISHED,
            UNITS,
            "0",
            PAIRED,
            "more completed than by Condensation, annealing and hybrid each",
        ),
        partial(_judge_pairs, lambda gain, *_: greater(gain, 0.0)),
        partial(_published, OF_200),
    ),
    Claim(
        "P0-6",
        "KAMS needs fewer layers than annealing",
        Rule(
            SHARE,
            f"published, KAMS with {FEW_LAYERS} layers against annealing with 5",
            UNITS,
            f"{MARGIN:g} %",
            PAIRED,
            "not fewer completed",
        ),
        partial(_judge_pairs, lambda gain, *_: greater(gain, -MARGIN)),
        _layers,
    ),
)
