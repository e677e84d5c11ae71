"""Claims of the KAMS paper (Naeem, Pridmore, Mills): sequences in clutter that trackers complete,
the number of particles that each filter needs, and how mean shift contracts the particles.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from servo.papers.claim import FRESH, WORDS, Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import contender, generated, sequence_jobs
from servo.papers.summaries import (
    column,
    completed,
    completed_more,
    done,
    dots,
    group,
    intervals,
    lines,
    mean,
    ratio,
    reads,
    words,
)
from servo.papers.tuning import AS_PUBLISHED, LEVELS, TUNED, published, tuned
from servo.study.run import Job
from servo.study.sequence_run import Contender, Generated, Recorded
from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.search.annealing import Annealing, anneal
from tracking.search.particles import ParticleFilter
from tracking.statistics.comparisons import Interval, McNemar, holm
from tracking.statistics.verdicts import Finding, greater, not_worse
from tracking.trackers import kams
from tracking.trackers._cloud import CLIMB, CLIMB_TOLERANCE

EASY = "abcd"
"""Levels of the paper's sequences."""
SEEDS = 16
SEEDS_ERROR = 10
RIVALS = ("condensation", "mean_shift", "annealed", "hybrid", "sok")
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
    """Return the painted (synthetic) sequences in clutter of one level, from "a" to "h"; each seed
    gives another sequence.
    """
    return generated("clutter", level=level)


def _painted(trackers: Sequence[Contender], effort: Effort) -> Sequence[Job]:
    """Return the runs of trackers on painted sequences of the hard levels, and on real sequences if
    the options name a folder of them.
    """
    real = [] if effort.sequences is None else Recorded.all_in(effort.sequences)
    hard = [clutter(level) for level in LEVELS]
    fresh = sequence_jobs(trackers, hard, effort.seeds(SEEDS), effort.pictures)
    return [*fresh, *sequence_jobs(trackers, real, range(1))]


def _compared(
    of: Callable[[str], Contender], rivals: Sequence[str], effort: Effort
) -> Sequence[Job]:
    """Return the runs of KAMS and of the kinds of trackers that it is compared with; `of` returns
    the tracker of a kind with its settings.
    """
    return _painted([of(kind) for kind in ("kams", *rivals)], effort)


def _layers(effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS with few annealing layers, and of the annealed particle filter
    without mean shift.
    """
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
    tests, tests_of_frames = (
        {o: McNemar.of(column(ours, measure), column(runs[o], measure)) for o in others}
        for measure in ("completed", "frames_until_loss")
    )
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
            f"{tests_of_frames[o].z:.2f}",
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


def _errors(effort: Effort) -> Sequence[Job]:
    """Return the runs of KAMS with published and tuned settings on the paper's levels."""
    trackers = [published("kams"), tuned("kams")]
    return sequence_jobs(
        trackers, [clutter(c) for c in EASY], effort.seeds(SEEDS_ERROR), effort.pictures
    )


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


KINDS = ("kams", "annealed", "hybrid", "condensation")
COUNTS = (12, 25, 50, 100, 200, 400)
LEVEL = "e"
SEEDS_PARTICLES = 32
ENOUGH = 0.9
"""Share of the sequences that must be completed."""
DRAWS = 2000
"""Number of bootstrap samples of the sequences behind an interval."""


def _label(kind: str, count: int) -> str:
    """Return the label of a tracker with a number of particles, for tables."""
    return f"{kind}-{count}-particles"


def _jobs_particles(effort: Effort) -> Sequence[Job]:
    """Return the runs of each filter with each number of particles."""
    trackers = [
        contender(TUNED[k].kind, "paper", _label(k, n), **AS_PUBLISHED[k] | {"particles": n})
        for k in KINDS
        for n in COUNTS
    ]
    return sequence_jobs(trackers, [clutter(LEVEL)], effort.seeds(SEEDS_PARTICLES), effort.pictures)


def needed(shares: Array) -> Array:
    """Return the number of particles with which 90 % of the sequences are completed, interpolated
    in the logarithm of the number.

    Args:
        shares: Shares of completed sequences, 0 to 1, with 12, 25, 50, 100, 200 and 400 particles,
            for each of n samples of the sequences (6, n).

    Returns:
        Number of particles for each sample (n,): 12 if the first share is large enough, 800 if none
        is.
    """
    logs = np.log2([*COUNTS, 2 * COUNTS[-1]])
    grown = np.vstack([np.maximum.accumulate(shares), np.full(shares.shape[1], 1.0)])
    at = np.argmax(grown >= ENOUGH, axis=0)
    i = np.arange(len(at))
    before = np.maximum(at - 1, 0)
    rise = np.maximum(grown[at, i] - grown[before, i], 1e-9)
    part = np.where((at == 0) | (at == len(COUNTS)), 1.0, (ENOUGH - grown[before, i]) / rise)
    return 2.0 ** (logs[before] + part * (logs[at] - logs[before]))


def _judge_particles(rivals: Sequence[str], bound: float, evidence: Evidence) -> Verdict:
    """Return the verdict on the numbers of particles that rivals need, divided by KAMS's: the claim
    holds if all ratios are above the bound.
    """
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
    """Return an estimate with its 95 % interval; `values` (1 + n,) are the estimate and n bootstrap
    samples of it.
    """
    low, high = np.percentile(values[1:], [2.5, 97.5])
    return Interval(float(values[0]), float(low), float(high))


def _claim_particles(name: str, says: str, rivals: Sequence[str], bound: float) -> Claim:
    """Return the claim that the rivals, other particle filters, need more than `bound` times as
    many particles as KAMS.
    """
    rule = Rule(
        f"particles with which {ENOUGH:.0%} of the sequences are completed, over KAMS's",
        f"the paper's presets with {', '.join(map(str, COUNTS))} particles",
        f"{SEEDS_PARTICLES} painted sequences of level {LEVEL}, seeds from {FRESH} on",
        "none",
        f"95 % percentile interval of {DRAWS} draws of the sequences",
        f"above {bound:g} for {', '.join(rivals)}",
    )
    return Claim(name, says, rule, partial(_judge_particles, rivals, bound), _jobs_particles)


SEEDS_LAYERS = 20
LEVEL_LAYERS = "b"
WARM_UP = 5
"""Number of first frames that do not count, because the particles start at the true state."""
KAMS: kams.Config = published("kams").config


def distances(seed: int, climb: int) -> Array:
    """Run the tracker KAMS on a painted sequence in clutter, and return the mean distance of a
    particle from its nearest neighbour in the image.

    Args:
        seed: Seed of the sequence and the particles.
        climb: Most steps of mean shift (the climb) in each layer of annealing; 0: no climb.

    Returns:
        Mean distances before and after the climb of each layer, the broadest layer first (2,
        layers) [px], over all pictures from the seventh on.
    """
    sequence = clutter(LEVEL_LAYERS).build(seed)
    pictures = [p.image for p in sequence.source if p.image is not None]
    model = KAMS.model(pictures[0], sequence.region, sequence.start)
    noise = (KAMS.noise, 0.0, 0.0)
    rng = np.random.default_rng(seed)
    cloud = ParticleFilter(sequence.region, sequence.start, KAMS.particles, noise, rng)
    layers = Annealing(KAMS.layers, KAMS.schedule)
    found: list[tuple[float, float]] = []

    def likelihood(image: LabelledImage, cloud: ParticleFilter) -> Array:
        """Return KAMS's log-likelihood of each particle (n,), and note the distances before and
        after the climb.
        """
        before = _nearest(cloud)
        if climb:
            cloud.samples, _, _ = model.climb(
                image, cloud.samples, most=climb, tolerance=CLIMB_TOLERANCE, reach=cloud.size
            )
        found.append((before, _nearest(cloud)))
        return -KAMS.gamma * model.energy(image, cloud.samples)

    for image in pictures[1:]:
        anneal(cloud, np.zeros(4), partial(likelihood, model.label(image)), layers, 1.0)
        cloud.resample()
    return np.array(found).reshape(-1, KAMS.layers, 2)[WARM_UP:].mean(axis=0).T


def _nearest(cloud: ParticleFilter) -> float:
    """Return the mean distance of the particles from their nearest neighbours [px]."""
    from scipy.spatial import KDTree  # takes a second

    at = cloud.samples[:, :2]
    return float(np.mean(KDTree(at).query(at, k=2)[0][:, 1]))


def _judge_layers(evidence: Evidence) -> Verdict:
    """Run KAMS with and without mean shift (the climb) on some sequences, and return the verdict on
    how mean shift contracts the particles.
    """
    seeds = evidence.effort.seeds(SEEDS_LAYERS)
    climbing = np.array([distances(seed, CLIMB) for seed in seeds])
    still = np.array([distances(seed, 0) for seed in seeds])
    return judged(climbing[:, 0], climbing[:, 1], still[:, 1])


def judged(before: Array, after: Array, still: Array) -> Verdict:
    """Return the verdict on the claim that mean shift (the climb) contracts the particles, from
    their mean distances to their nearest neighbours. It holds if the geometric mean ratios of
    `after` to `before` and to `still` are below 1, with their whole 95 % intervals, in every layer
    of annealing.

    Args:
        before: Distances before the climb of each layer, the broadest layer first (sequences,
            layers) [px].
        after: Distances after the climb of each layer, in the same order [px].
        still: Distances after each layer in runs without climb, in the same order [px].
    """
    over_before = [ratio(a, b) for a, b in zip(after.T, before.T, strict=True)]
    over_still = [ratio(a, b) for a, b in zip(after.T, still.T, strict=True)]
    both = [*over_before, *over_still]
    layers = [str(m) for m in reversed(range(len(over_before)))]
    drawn = {f"layer {m}, over before": i for m, i in zip(layers, over_before, strict=True)}
    drawn |= {f"layer {m}, over without": i for m, i in zip(layers, over_still, strict=True)}
    table = [
        ["layer", *layers],
        ["before the climb [px]", *(f"{v:.2f}" for v in before.mean(axis=0))],
        ["after [px]", *(f"{v:.2f}" for v in after.mean(axis=0))],
        ["without climbing [px]", *(f"{v:.2f}" for v in still.mean(axis=0))],
        ["after over before", *map(words, over_before)],
        ["after over without", *map(words, over_still)],
    ]
    return Verdict(
        every(not_worse(i, 1.0) for i in both),
        max(both, key=lambda i: i.high),
        "times the distance (worst layer)",
        len(after),
        f"after the climb {words(over_before[0])} of before in the broadest layer, "
        f"{words(over_before[-1])} in the sharpest",
        table,
        intervals("distance from the nearest neighbour after the climb", "ratio", drawn),
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
        partial(_compared, published, RIVALS),
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
        partial(_compared, tuned, RIVALS),
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
        partial(_compared, published, ("condensation", "annealed", "hybrid")),
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
    Claim(
        "P0-3",
        "annealing draws the particles together, and mean shift draws them further "
        "together (figure 5)",
        Rule(
            "mean distance of a particle from its nearest neighbour after the climb, over that "
            "before it, and over that in the same layer of a run without climbing",
            "KAMS as published; the same noise and draws without climbing",
            f"{SEEDS_LAYERS} painted sequences of level {LEVEL_LAYERS}, seeds from 1000 on",
            "1",
            "95 % interval of the geometric mean ratio",
            "both below 1 in every layer",
        ),
        _judge_layers,
    ),
    _claim_particles("P0-4", "KAMS needs the fewest particles", KINDS[1:], 1.0),
    _claim_particles("P0-7", "KAMS needs fewer particles than the hybrid", ("hybrid",), 1.0),
    _claim_particles("P0-8", "KAMS needs 75 % fewer particles", KINDS[1:], 4.0),
)
