"""Claims of the KAMS paper: kernel annealed mean shift in clutter (Naeem, Pridmore, Mills)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from servo.batch.jobs import Job
from servo.bench.ranking import compare
from servo.bench.sequence_jobs import Generated, Recorded
from servo.papers.claim import COLOURS, Claim, Effort, Verdict, panels
from servo.papers.experiments import Experiment, contender, generated, sequence_jobs
from servo.papers.groups import Result, by_tracker, column, group
from sim.types import Array
from tracking.appearance.bins import Labelled
from tracking.evaluation.drawing import figures
from tracking.evaluation.sequences.sequence import read_all
from tracking.evaluation.sequences.sources import RATE
from tracking.evaluation.statistics import McNemar, holm
from tracking.files.json_text import as_json
from tracking.search.annealing import Annealing, Schedule, anneal
from tracking.search.particles import ParticleFilter

LEVELS = "abcd"
SEEDS_Z, SEEDS_ERROR, SEEDS_SPREAD = 16, 10, 10
SIGNIFICANT = 2.58
"""z at the two-sided 1 % level."""
PAPER_Z = {"condensation": 2.91, "mean_shift": 5.13, "annealed": 3.80, "hybrid": 4.83, "sok": 3.59}
"""z of KAMS against each tracker, from table 1 of the KAMS paper."""
BUDGET = {"condensation": {"particles": 1000}, "annealed": {"particles": 200},
          "hybrid": {"particles": 180}, "mean_shift": {}, "sok": {}}  # fmt: skip
"""Settings with which each reads about 1000 histograms, as KAMS with 40 particles does."""
SMALL, SMALL_D, OF_D = 3.0, 8.0, 0.8
"""Largest mean error on levels a to c and on d [px], and the least share of d completed."""
WARM_UP = 5
KAMS = contender("kams", "paper")


def clutter(level: str) -> Generated:
    """The artificial sequences of one level."""
    return generated("clutter", level=level)


def _first(effort: Effort) -> Sequence[Job]:
    trackers = [KAMS, *(contender(kind, "paper") for kind in BUDGET)]
    trackers += [contender(k, "paper", f"{k}-equal", **s) for k, s in BUDGET.items() if s]
    real = (
        []
        if effort.sequences is None
        else [Recorded(effort.sequences, s.name) for s in read_all(effort.sequences, RATE)]
    )
    painted = [clutter(level) for level in LEVELS]
    return [job for tracker in trackers for job in (
        *sequence_jobs([tracker], painted, effort.seeds(SEEDS_Z)),
        *sequence_jobs([tracker], real, range(1)),
    )]  # fmt: skip


def _judge_first(results: list[Result], folder: Path) -> Verdict:
    ours = group(results, tracker="kams-paper")
    tests = {k: compare(ours, group(results, tracker=f"{k}-paper")) for k in BUDGET}
    equal = {k: compare(ours, group(results, tracker=f"{k}-equal")) for k in BUDGET if BUDGET[k]}
    corrected = holm(np.array([test.p for test in tests.values()]))
    table = [["KAMS against", "paper's z", "z", "won-lost-tied", "p (Holm)", "z at equal reads",
              "won-lost-tied"]]  # fmt: skip
    for (kind, test), p in zip(tests.items(), corrected.tolist(), strict=True):
        same = equal.get(kind, test)
        table.append([kind, f"{PAPER_Z[kind]:.2f}", f"{test.z:.2f}", _split(test), f"{p:.2g}",
                      f"{same.z:.2f}", _split(same)])  # fmt: skip
    holds = all(t.z > SIGNIFICANT and t.wins > t.losses for t in tests.values())
    least = min(test.z for test in tests.values())
    figure, (ax,) = panels(1)
    runs = dict(sorted(by_tracker(results).items()))
    means = [column(found, "frames_until_loss").mean() for found in runs.values()]
    ax.barh(list(runs), means, color=[COLOURS[0] if "kams" in n else COLOURS[5] for n in runs])
    ax.set(xlabel="mean frames until loss", title="P0-1: KAMS and five others")
    return Verdict(
        f"least z {least:.2f} over {len(ours)} sequences at the papers' settings",
        holds, table, [figures.save(figure, folder, "P0-1.png")],
    )  # fmt: skip


def _split(test: McNemar) -> str:
    return f"{test.wins}-{test.losses}-{test.ties}"


def _second(effort: Effort) -> Sequence[Job]:
    trackers = [contender(kind, "paper") for kind in ("hybrid", "sok")]
    levels = [clutter(level) for level in LEVELS]
    return sequence_jobs([*trackers, KAMS, contender("kams")], levels, effort.seeds(SEEDS_ERROR))


def _judge_second(results: list[Result], folder: Path) -> Verdict:
    table = [["tracker", *(f"{level}: error [px], completed" for level in LEVELS)]]
    figure, (ax,) = panels(1)
    for i, (label, found) in enumerate(by_tracker(results).items()):
        groups = [group(found, family=f"clutter-{level}") for level in LEVELS]
        errors = [column(g, "mean_error_px") for g in groups]
        done = [column(g, "completed") for g in groups]
        table.append([label, *(f"{e.mean():.1f}, {int(d.sum())} of {len(d)}"
                               for e, d in zip(errors, done, strict=True))])  # fmt: skip
        at = np.arange(len(LEVELS)) + 0.2 * (i - 1.5)
        ax.bar(at, [e.mean() for e in errors], 0.18, label=label, color=COLOURS[i])
    ax.set_xticks(range(len(LEVELS)), [f"level {level}" for level in LEVELS])
    ax.set(ylabel="mean error [px]", title="P0-2: mean error over all frames", yscale="log")
    ax.legend(frameon=False)
    runs = [group(results, tracker="kams", family=f"clutter-{level}") for level in LEVELS]
    worst = max(column(g, "mean_error_px").max() for g in runs[:3])
    easy = all(column(g, "completed").all() for g in runs[:3]) and worst < SMALL
    hard = column(runs[3], "completed") * (column(runs[3], "mean_error_px") < SMALL_D)
    return Verdict(
        f"KAMS: a to c {'all' if easy else 'not all'} completed, worst mean error {worst:.1f} px; "
        f"d completed within {SMALL_D:g} px in {int(hard.sum())} of {len(hard)}",
        bool(easy and hard.mean() >= OF_D), table, [figures.save(figure, folder, "P0-2.png")],
    )  # fmt: skip


def _spreads(seed: int) -> Result:
    """Spread of KAMS's particles [px] in each layer (2, layers), before and after mean shift."""
    c, sequence = KAMS.config, clutter("b").build(seed)
    pictures = [p.image for p in sequence.source if p.image is not None]
    model = c.model(pictures[0], sequence.region, sequence.start)
    rng = np.random.default_rng(seed)
    cloud = ParticleFilter(sequence.region, sequence.start, c.particles, (c.noise, 0.0, 0.0), rng)
    layers = Annealing(c.layers, Schedule(c.schedule), c.survival, c.ratio, c.cooling)
    spreads: list[tuple[float, float]] = []
    reach = float(np.sqrt(sequence.region.area(sequence.start)))
    for image in pictures[1:]:
        likelihood = _probe(model, model.label(image), c, reach, spreads)
        anneal(cloud, np.zeros(4), likelihood, layers, 1.0)
        cloud.resample()
    kept = np.array(spreads).reshape(-1, c.layers, 2)[WARM_UP:]
    return {"tracker": KAMS.label, "spread": kept.mean(axis=0).T.tolist()}


def _third(effort: Effort) -> Sequence[Job]:
    about = {"tracker": as_json(KAMS.config), "sequence": clutter("b").describe()}
    return [Experiment("spread", about, _spreads, s) for s in effort.seeds(SEEDS_SPREAD)]


def _probe(
    model: Any, image: Labelled, config: Any, reach: float, spreads: list[tuple[float, float]]
) -> Callable[[ParticleFilter], Array]:
    """KAMS's likelihood, which also records the spread before and after the climb."""

    def likelihood(cloud: ParticleFilter) -> Array:
        before = _spread(cloud)
        cloud.samples, _, _ = model.climb(
            image, cloud.samples, most=config.climb, tolerance=0.5, reach=reach
        )
        spreads.append((before, _spread(cloud)))
        return config.log_likelihood(model.energy(image, cloud.samples))

    return likelihood


def _spread(cloud: ParticleFilter) -> float:
    return float(np.sqrt(np.sum(np.var(cloud.samples[:, :2], axis=0))))


def _judge_third(results: list[Result], folder: Path) -> Verdict:
    before, after = np.mean([r["spread"] for r in results], axis=0)
    layers = len(before)
    figure, (ax,) = panels(1)
    at = np.arange(layers)
    ax.plot(at, before, "o-", color=COLOURS[1], label="before mean shift")
    ax.plot(at, after, "o-", color=COLOURS[0], label="after mean shift")
    ax.set_xticks(at, [str(layers - 1 - i) for i in range(layers)])
    ax.set(xlabel="layer m, from broad to sharp", ylabel="spread of the particles [px]",
           title="P0-3: spread in each annealing layer", ylim=(0, None))  # fmt: skip
    ax.legend(frameon=False)
    table = [["layer", *(str(layers - 1 - i) for i in range(layers))],
             ["before [px]", *(f"{v:.1f}" for v in before)],
             ["after [px]", *(f"{v:.1f}" for v in after)]]  # fmt: skip
    holds = bool(after[-1] < before[0] / 2 and after.sum() < before.sum())
    return Verdict(
        f"from {before[0]:.1f} px before the first climb to {after[-1]:.1f} px after the last",
        holds, table, [figures.save(figure, folder, "P0-3.png")],
    )  # fmt: skip


CLAIMS = (
    Claim("P0-1", "KAMS tracks for longer than each of five others (McNemar, 36 sequences, z from "
          "2.91 to 5.13)", _first, _judge_first),
    Claim("P0-2", "KAMS completes levels a to d with mean errors of 6.9, 18.2, 14.7, 17.3 px",
          _second, _judge_second),
    Claim("P0-3", "annealing draws the particles together, and mean shift draws them further "
          "together (figure 5)", _third, _judge_third),
)  # fmt: skip
