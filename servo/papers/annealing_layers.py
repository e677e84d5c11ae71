"""Claim of the KAMS paper about its layers: mean shift draws the particles together."""

from functools import partial

import numpy as np

from servo.papers.claim import Claim, Evidence, Rule, Verdict, every
from servo.papers.drawing import intervals
from servo.papers.groups import ratio, words
from servo.papers.kams_paper import clutter
from servo.papers.tuning import published
from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.search.annealing import Annealing, anneal
from tracking.search.particles import ParticleFilter
from tracking.statistics.verdicts import not_worse
from tracking.trackers import kams
from tracking.trackers._cloud import CLIMB, CLIMB_TOLERANCE

SEEDS = 20
LEVEL = "b"
WARM_UP = 5
"""First frames of a sequence that do not count: the cloud starts at the true place."""
KAMS: kams.Config = published("kams").config


def distances(seed: int, climb: int) -> Array:
    """Return the mean distance of a particle from its nearest neighbour, over a sequence's frames.

    Args:
        seed: Draws the sequence and the particles.
        climb: Most steps of mean shift in each layer; 0: the layers do not climb.

    Returns:
        Distances before and after the climb (2, layers) [px].
    """
    sequence = clutter(LEVEL).build(seed)
    pictures = [p.image for p in sequence.source if p.image is not None]
    model = KAMS.model(pictures[0], sequence.region, sequence.start)
    noise = (KAMS.noise, 0.0, 0.0)
    rng = np.random.default_rng(seed)
    cloud = ParticleFilter(sequence.region, sequence.start, KAMS.particles, noise, rng)
    layers = Annealing(KAMS.layers, KAMS.schedule)
    found: list[tuple[float, float]] = []

    def likelihood(image: LabelledImage, cloud: ParticleFilter) -> Array:
        """Return KAMS's likelihood, and keep the distances around its climb."""
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
    from scipy.spatial import KDTree  # takes a second

    at = cloud.samples[:, :2]
    return float(np.mean(KDTree(at).query(at, k=2)[0][:, 1]))


def _judge(evidence: Evidence) -> Verdict:
    seeds = evidence.effort.seeds(SEEDS)
    climbing = np.array([distances(seed, CLIMB) for seed in seeds])
    still = np.array([distances(seed, 0) for seed in seeds])
    return judged(climbing[:, 0], climbing[:, 1], still[:, 1])


def judged(before: Array, after: Array, still: Array) -> Verdict:
    """Return the verdict on distances (sequences, layers) [px].

    Args:
        before: Before the climb of each layer.
        after: After it.
        still: After the same layer of a run without climbing.
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
            f"{SEEDS} painted sequences of level {LEVEL}, seeds from 1000 on",
            "1",
            "95 % interval of the geometric mean ratio",
            "both below 1 in every layer",
        ),
        _judge,
    ),
)
