"""Claims of the KAMS paper about how many particles each filter needs in clutter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.papers.claim import COLOURS, FRESH, Claim, Effort, Rule, Verdict, every, panels
from servo.papers.experiments import contender, sequence_jobs
from servo.papers.groups import Result, column, group, words
from servo.papers.kams_paper import clutter
from servo.papers.tuning import AS_PUBLISHED, TUNED
from sim.types import Array
from tracking.drawing import figures
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import greater

KINDS = ("kams", "annealed", "hybrid", "condensation")
COUNTS = (12, 25, 50, 100, 200, 400)
LEVEL = "e"
SEEDS = 32
ENOUGH = 0.9
"""Share of the sequences that must be completed."""
DRAWS = 2000
FEWER = 4.0
"""75 % fewer."""


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
    """Particles (n,) at which shares (counts, n) reach `ENOUGH`, between counts by the logarithm;
    twice the largest count where they do not.
    """
    logs = np.log2([*COUNTS, 2 * COUNTS[-1]])
    grown = np.vstack([np.maximum.accumulate(shares), np.full(shares.shape[1], 1.0)])
    at = np.argmax(grown >= ENOUGH, axis=0)
    i = np.arange(len(at))
    before = np.maximum(at - 1, 0)
    rise = np.maximum(grown[at, i] - grown[before, i], 1e-9)
    part = np.where((at == 0) | (at == len(COUNTS)), 1.0, (ENOUGH - grown[before, i]) / rise)
    return 2.0 ** (logs[before] + part * (logs[at] - logs[before]))


def _of_draws(results: Sequence[Result]) -> dict[str, Array]:
    """Particles needed (1 + draws,) by tracker: of all sequences, then of sequences drawn anew, the
    same for all trackers.
    """
    done = {
        k: np.array([column(group(results, tracker=_label(k, n)), "completed") for n in COUNTS])
        for k in KINDS
    }
    size = done[KINDS[0]].shape[1]
    drawn = np.random.default_rng(0).integers(0, size, (DRAWS, size))
    which = np.vstack([np.arange(size), drawn])
    return {k: needed(d[:, which].mean(axis=2)) for k, d in done.items()}


def _judge(
    results: list[Result], folder: Path, name: str, rivals: Sequence[str], bound: float
) -> Verdict:
    found = _of_draws(results)
    ratios = {k: _interval(found[k] / found["kams"]) for k in rivals}
    nearest = min(ratios, key=lambda k: ratios[k].low)
    table = [["tracker", f"particles for {ENOUGH:.0%}", "over KAMS's", *map(str, COUNTS)]]
    figure, (ax,) = panels(1)
    for i, k in enumerate(KINDS):
        shares = [
            100 * column(group(results, tracker=_label(k, n)), "completed").mean() for n in COUNTS
        ]
        table.append(
            [
                k,
                words(_interval(found[k])),
                words(_interval(found[k] / found["kams"])),
                *(f"{s:.0f} %" for s in shares),
            ]
        )
        ax.plot(COUNTS, shares, "o-", color=COLOURS[i], label=k)
    ax.axhline(100 * ENOUGH, color="#111111", lw=0.8, ls="--")
    ax.set_xscale("log", base=2)
    ax.set_xticks(COUNTS, map(str, COUNTS))
    ax.set(
        xlabel="particles",
        ylabel="sequences completed [%]",
        ylim=(0, 102),
        title=f"{name}: completion by number of particles",
    )
    ax.legend(frameon=False)
    return Verdict(
        every(greater(i, bound) for i in ratios.values()),
        ratios[nearest],
        "times KAMS's particles",
        len(group(results, tracker=_label("kams", COUNTS[0]))),
        f"least ratio of particles needed: {nearest} ({2 * COUNTS[-1]} stands for more than "
        f"{COUNTS[-1]})",
        table,
        [figures.save(figure, folder, f"{name}.png")],
    )


def _interval(values: Array) -> Interval:
    """The first value, with the percentile interval of the others, which were drawn."""
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
    return Claim(name, says, rule, _jobs, lambda r, f: _judge(r, f, name, rivals, bound))


CLAIMS = (
    _claim("P0-4", "KAMS needs the fewest particles", KINDS[1:], 1.0),
    _claim("P0-7", "KAMS needs fewer particles than the hybrid", ("hybrid",), 1.0),
    _claim("P0-8", "KAMS needs 75 % fewer particles", KINDS[1:], FEWER),
)
