"""Claims of the KAMS paper about particles: the number that each filter needs in clutter, and their
contraction by mean shift in every layer.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from servo.papers.claim import FRESH, Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import contender, sequence_jobs
from servo.papers.kams_paper import clutter
from servo.papers.summaries import column, group, intervals, lines, ratio, words
from servo.papers.tuning import AS_PUBLISHED, TUNED, published
from servo.study.run import Job
from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.search.annealing import Annealing, anneal
from tracking.search.particles import ParticleFilter
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import greater, not_worse
from tracking.trackers import kams
from tracking.trackers._cloud import CLIMB, CLIMB_TOLERANCE

KINDS = ("kams", "annealed", "hybrid", "condensation")
COUNTS = (12, 25, 50, 100, 200, 400)
LEVEL = "e"
SEEDS = 32
ENOUGH = 0.9
"""Share of the sequences that must be completed."""
DRAWS = 2000
"""Number of bootstrap samples of the sequences behind an interval."""
FEWER = 4.0
"""Least ratio that is 75 % fewer."""


def _label(kind: str, count: int) -> str:
    """Return the label of a tracker with a number of particles."""
    return f"{kind}-{count}-particles"


def _jobs(effort: Effort) -> Sequence[Job]:
    """Return the runs of each filter with each number of particles."""
    trackers = [
        contender(TUNED[k].kind, "paper", _label(k, n), **AS_PUBLISHED[k] | {"particles": n})
        for k in KINDS
        for n in COUNTS
    ]
    return sequence_jobs(trackers, [clutter(LEVEL)], effort.seeds(SEEDS))


def needed(shares: Array) -> Array:
    """Return the number of particles with which a share `ENOUGH` of sequences is completed,
    interpolated in the logarithm of the number.

    Args:
        shares: Share of completed sequences for each of `COUNTS`, in n samples (counts, n).

    Returns:
        Numbers of particles (n,); twice the largest of `COUNTS` if no share is large enough.
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
    """Return an estimate with its 95 % interval, from values (1 + n,): the estimate and n bootstrap
    samples of it.
    """
    low, high = np.percentile(values[1:], [2.5, 97.5])
    return Interval(float(values[0]), float(low), float(high))


def _claim(name: str, says: str, rivals: Sequence[str], bound: float) -> Claim:
    """Return the claim that rivals need more than `bound` times as many particles as KAMS."""
    rule = Rule(
        f"particles with which {ENOUGH:.0%} of the sequences are completed, over KAMS's",
        f"the paper's presets with {', '.join(map(str, COUNTS))} particles",
        f"{SEEDS} painted sequences of level {LEVEL}, seeds from {FRESH} on",
        "none",
        f"95 % percentile interval of {DRAWS} draws of the sequences",
        f"above {bound:g} for {', '.join(rivals)}",
    )
    return Claim(name, says, rule, partial(_judge, rivals, bound), _jobs)


SEEDS_LAYERS = 20
LEVEL_LAYERS = "b"
WARM_UP = 5
"""Number of first frames that do not count, because the particles start at the true state."""
KAMS: kams.Config = published("kams").config


def distances(seed: int, climb: int) -> Array:
    """Run KAMS on a sequence, and return the mean distance of a particle from its nearest neighbour
    in the image.

    Args:
        seed: Seed of the sequence and the particles.
        climb: Most steps of mean shift (the climb) in each layer of annealing; 0: no climb.

    Returns:
        Mean distances before and after the climb of each layer (2, layers) [px].
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
    """Run KAMS with and without the climb on some sequences, and return the verdict."""
    seeds = evidence.effort.seeds(SEEDS_LAYERS)
    climbing = np.array([distances(seed, CLIMB) for seed in seeds])
    still = np.array([distances(seed, 0) for seed in seeds])
    return judged(climbing[:, 0], climbing[:, 1], still[:, 1])


def judged(before: Array, after: Array, still: Array) -> Verdict:
    """Return the verdict on mean distances of particles from their nearest neighbours.

    Args:
        before: Distances before the climb of each layer (sequences, layers) [px].
        after: Distances after the climb, likewise.
        still: Distances after the same layers of runs without climb, likewise.
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


CLAIMS = (
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
    _claim("P0-4", "KAMS needs the fewest particles", KINDS[1:], 1.0),
    _claim("P0-7", "KAMS needs fewer particles than the hybrid", ("hybrid",), 1.0),
    _claim("P0-8", "KAMS needs 75 % fewer particles", KINDS[1:], FEWER),
)
