"""Claims of the KAMS paper about who completes: kernel annealed mean shift in clutter (Naeem,
Pridmore, Mills).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.bench.sequence_jobs import Contender, Generated, Recorded, compare
from servo.papers.claim import (
    COLOURS,
    WORDS,
    Claim,
    Effort,
    Rule,
    Verdict,
    every,
    panels,
    plain_ticks,
)
from servo.papers.experiments import contender, generated, sequence_jobs
from servo.papers.groups import (
    Result,
    by_tracker,
    column,
    completed,
    completed_more,
    group,
    mean,
    words,
)
from servo.papers.tuning import AS_PUBLISHED, LEVELS, published, tuned
from tracking.drawing import figures
from tracking.sequences.sequence import read_all
from tracking.sequences.sources import RATE
from tracking.statistics.comparisons import Interval, McNemar, holm
from tracking.statistics.verdicts import Finding, greater, not_worse

EASY = "abcd"
"""Levels of the paper's sequences."""
SEEDS = 16
SEEDS_ERROR = 10
RIVALS = ("condensation", "mean_shift", "annealed", "hybrid", "sok")
OF_200 = ("condensation", "annealed", "hybrid")
PAPER_Z = {"condensation": 2.91, "mean_shift": 5.13, "annealed": 3.80, "hybrid": 4.83, "sok": 3.59}
"""z of KAMS against each tracker, from table 1 of the KAMS paper."""
PAPER_PX = (6.9, 18.2, 14.7, 17.3)
"""Its mean errors on levels a to d [px]."""
MARGIN = 5.0
SIGNIFICANT = 0.05
"""Margin of "not fewer" [%], and p value."""
LEAST_D = 8
FEW_LAYERS = 3


def clutter(level: str) -> Generated:
    """The artificial sequences of one level."""
    return generated("clutter", level=level)


def _painted(effort: Effort, trackers: Sequence[Contender]) -> list[Job]:
    """The trackers, and some real sequences too if there are any."""
    real = (
        []
        if effort.sequences is None
        else [Recorded(effort.sequences, s.name) for s in read_all(effort.sequences, RATE)]
    )
    painted = [clutter(level) for level in LEVELS]
    fresh = sequence_jobs(trackers, painted, effort.seeds(SEEDS))
    return [*fresh, *sequence_jobs(trackers, real, range(1))]


def _published(effort: Effort) -> Sequence[Job]:
    return _painted(effort, [published(k) for k in ("kams", *RIVALS)])


def _equal(effort: Effort) -> Sequence[Job]:
    return _painted(effort, [tuned(k) for k in ("kams", *RIVALS)])


def _layers(effort: Effort) -> Sequence[Job]:
    few = contender(
        "kams", "paper", f"kams-{FEW_LAYERS}-layers", layers=FEW_LAYERS, **AS_PUBLISHED["kams"]
    )
    return _painted(effort, [few, published("annealed")])


def _judge_pairs(results: list[Result], folder: Path, name: str, way: str) -> Verdict:
    """KAMS, whose results come first, against each other: "not fewer" completed, "more", or
    "significantly" more.
    """
    runs = by_tracker(results)
    first, *others = runs
    ours = runs[first]
    gains = {o: completed_more(ours, runs[o]) for o in others}
    tests = {o: compare(ours, runs[o], "completed") for o in others}
    corrected = dict(zip(others, holm(np.array([t.p for t in tests.values()])), strict=True))
    if way == "not fewer":
        findings = {o: not_worse(_turned(i), MARGIN) for o, i in gains.items()}
    elif way == "more":
        findings = {o: greater(i, 0.0) for o, i in gains.items()}
    else:
        findings = {o: _significant(tests[o], corrected[o]) for o in others}
    nearest = min(others, key=lambda o: gains[o].value)
    table = [
        ["", "done", "KAMS more [%]", "won-lost", "p (Holm)", "z of frames", "paper", "reads", ""],
        [first, _done(ours), "", "", "", "", "", _reads(ours), ""],
    ]
    for o in others:
        longer = compare(ours, runs[o])
        told = f"{PAPER_Z[kind]:.2f}" if (kind := o.rpartition("-")[0]) in PAPER_Z else ""
        table.append(
            [
                o,
                _done(runs[o]),
                words(gains[o]),
                f"{tests[o].wins}-{tests[o].losses}",
                f"{corrected[o]:.2g}",
                f"{longer.z:.2f}",
                told,
                _reads(runs[o]),
                WORDS[findings[o]],
            ]
        )
    open_ = [o for o in others if findings[o] is not Finding.HOLDS]
    said = f"against {', '.join(open_)} it is open or false" if open_ else "against all"
    return Verdict(
        every(findings.values()),
        gains[nearest],
        "% of the sequences",
        len(ours),
        f"{first} completes {_done(ours)}; {said}; the effect is that against {nearest}",
        table,
        [_draw_completed(runs, folder, name)],
    )


def _turned(i: Interval) -> Interval:
    return Interval(-i.value, -i.high, -i.low)


def _significant(test: McNemar, p: float) -> Finding:
    if p >= SIGNIFICANT:
        return Finding.UNDECIDED
    return Finding.HOLDS if test.wins > test.losses else Finding.DOES_NOT_HOLD


def _done(runs: Sequence[Result]) -> str:
    return f"{int(column(runs, 'completed').sum())} of {len(runs)}"


def _reads(runs: Sequence[Result]) -> str:
    return f"{column(runs, 'evaluations').mean():.0f}"


def _draw_completed(runs: dict[str, list[Result]], folder: Path, name: str) -> Path:
    figure, (ax,) = panels(1)
    shares = [completed(found) for found in runs.values()]
    for i, share in enumerate(shares):
        ends = [[share.value - share.low], [share.high - share.value]]
        ax.errorbar(
            [share.value],
            [i],
            xerr=np.maximum(ends, 0),
            fmt="o",
            capsize=3,
            color=COLOURS[0 if i == 0 else 5],
        )
    ax.set_yticks(range(len(runs)), list(runs))
    ax.invert_yaxis()
    ax.set(
        xlabel="sequences completed [%], with 95 % intervals",
        xlim=(-2, 102),
        title=f"{name}: who completes",
    )
    return figures.save(figure, folder, f"{name}.png")


def _errors(effort: Effort) -> Sequence[Job]:
    levels = [clutter(level) for level in EASY]
    return sequence_jobs([published("kams"), tuned("kams")], levels, effort.seeds(SEEDS_ERROR))


def _judge_errors(results: list[Result], folder: Path) -> Verdict:
    table = [
        ["settings", *(f"{level}: mean error [px], completed" for level in EASY)],
        ["the paper's result", *(f"{px:g}" for px in PAPER_PX)],
    ]
    figure, (ax,) = panels(1)
    for i, (label, found) in enumerate(by_tracker(results).items()):
        groups = [group(found, family=f"clutter-{level}") for level in EASY]
        table.append([label, *(f"{mean(g, 'mean_error_px')}, {_done(g)}" for g in groups)])
        for at, runs in enumerate(groups):
            errors = column(runs, "mean_error_px")
            ax.plot(
                at + 0.2 * (i - 0.5) + np.linspace(-0.06, 0.06, len(errors)),
                errors,
                ".",
                color=COLOURS[i],
                label=label if at == 0 else None,
            )
    ax.plot(range(len(EASY)), PAPER_PX, "_", ms=30, color=COLOURS[5], label="paper's result")
    ax.set_xticks(range(len(EASY)), [f"level {level}" for level in EASY])
    ax.set(ylabel="mean error [px]", yscale="log", title="P0-2: mean error, one dot a sequence")
    plain_ticks(ax.yaxis)
    ax.legend(frameon=False)
    ours = group(results, tracker=published("kams").label)
    done = [column(group(ours, family=f"clutter-{level}"), "completed") for level in EASY]
    kept = all(d.all() for d in done[:-1]) and done[-1].mean() >= LEAST_D / SEEDS_ERROR
    said = ", ".join(
        f"{level} {int(d.sum())} of {len(d)}" for level, d in zip(EASY, done, strict=True)
    )
    return Verdict(
        Finding.HOLDS if kept else Finding.DOES_NOT_HOLD,
        completed(ours),
        "% of the sequences",
        len(ours),
        f"completed with published settings: {said}",
        table,
        [figures.save(figure, folder, "P0-2.png")],
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
        _published,
        lambda r, f: _judge_pairs(r, f, "P0-1a", "not fewer"),
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
        _equal,
        lambda r, f: _judge_pairs(r, f, "P0-1b", "significantly"),
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
        _errors,
        _judge_errors,
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
        lambda e: _painted(e, [published(k) for k in ("kams", *OF_200)]),
        lambda r, f: _judge_pairs(r, f, "P0-5", "more"),
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
        _layers,
        lambda r, f: _judge_pairs(r, f, "P0-6", "not fewer"),
    ),
)
