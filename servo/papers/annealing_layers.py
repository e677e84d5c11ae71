"""Claim of the KAMS paper about its layers: mean shift draws the particles together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.papers.claim import COLOURS, Claim, Effort, Rule, Verdict, every, panels
from servo.papers.experiments import Experiment
from servo.papers.groups import Result, ratio, words
from servo.papers.kams_paper import clutter
from servo.papers.tuning import published
from sim.types import Array
from tracking.appearance.bins import LabelledImage
from tracking.appearance.model import SampledModel
from tracking.drawing import figures
from tracking.files.json_text import as_json
from tracking.search.annealing import Annealing, anneal
from tracking.search.particles import ParticleFilter
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding, not_worse
from tracking.trackers import kams
from tracking.trackers._cloud import CLIMB, CLIMB_TOLERANCE

SEEDS = 20
LEVEL = "b"
WARM_UP = 5
KAMS: kams.Config = published("kams").config
WITH = "with"
WITHOUT = "without"


def _nearest(cloud: ParticleFilter) -> float:
    """Mean distance of each particle from its nearest neighbour [px]."""
    from scipy.spatial import KDTree  # takes a second

    at = cloud.samples[:, :2]
    return float(np.mean(KDTree(at).query(at, k=2)[0][:, 1]))


def _probe(
    model: SampledModel, image: LabelledImage, climb: int, found: list[tuple[float, float]]
) -> Callable[[ParticleFilter], Array]:
    """KAMS's likelihood, which also keeps the distances before and after the climb."""

    def likelihood(cloud: ParticleFilter) -> Array:
        before = _nearest(cloud)
        if climb:
            cloud.samples, _, _ = model.climb(
                image, cloud.samples, most=climb, tolerance=CLIMB_TOLERANCE, reach=cloud.size
            )
        found.append((before, _nearest(cloud)))
        return -KAMS.gamma * model.energy(image, cloud.samples)

    return likelihood


def _distances(seed: int, climb: int) -> list[list[float]]:
    """Distances [px] before and after the climb (2, layers), the mean of a sequence's frames."""
    c = KAMS
    sequence = clutter(LEVEL).build(seed)
    pictures = [p.image for p in sequence.source if p.image is not None]
    model = c.model(pictures[0], sequence.region, sequence.start)
    rng = np.random.default_rng(seed)
    cloud = ParticleFilter(sequence.region, sequence.start, c.particles, (c.noise, 0.0, 0.0), rng)
    layers = Annealing(c.layers, c.schedule)
    found: list[tuple[float, float]] = []
    for image in pictures[1:]:
        anneal(cloud, np.zeros(4), _probe(model, model.label(image), climb, found), layers, 1.0)
        cloud.resample()
    return np.array(found).reshape(-1, c.layers, 2)[WARM_UP:].mean(axis=0).T.tolist()


def _both(seed: int) -> Result:
    return {WITH: _distances(seed, CLIMB), WITHOUT: _distances(seed, 0)}


def _jobs(effort: Effort) -> Sequence[Job]:
    about = {"tracker": as_json(KAMS), "sequence": clutter(LEVEL).describe()}
    return [Experiment("neighbours", about, _both, s) for s in effort.seeds(SEEDS)]


def _judge(results: list[Result], folder: Path) -> Verdict:
    before, after = (np.array([r[WITH][i] for r in results]) for i in range(2))
    alone = np.array([r[WITHOUT][1] for r in results])
    own, other = (
        [ratio(a, b) for a, b in zip(after.T, than.T, strict=True)] for than in (before, alone)
    )
    worst = max((*own, *other), key=lambda i: i.high)
    names = [str(m) for m in reversed(range(len(own)))]
    table = [
        ["layer", *names],
        ["before the climb [px]", *(f"{v:.2f}" for v in before.mean(axis=0))],
        ["after [px]", *(f"{v:.2f}" for v in after.mean(axis=0))],
        ["without climbing [px]", *(f"{v:.2f}" for v in alone.mean(axis=0))],
        ["after over before", *map(words, own)],
        ["after over without", *map(words, other)],
    ]
    figure, (ax,) = panels(1)
    for i, (label, found) in enumerate(
        (
            ("after over before the climb", own),
            ("after over the same layer without climbing", other),
        )
    ):
        at = np.arange(len(found)) + 0.1 * (i - 0.5)
        values = np.array([f.value for f in found])
        ends = np.abs(np.array([(f.low, f.high) for f in found]).T - values)
        ax.errorbar(at, values, ends, fmt="o", capsize=3, color=COLOURS[i], label=label)
    ax.axhline(1.0, color="#111111", lw=0.8, ls="--")
    ax.set_xticks(range(len(names)), names)
    ax.set(
        xlabel="layer m, from broad to sharp",
        ylabel="ratio of distances",
        ylim=(0, None),
        title="P0-3: distance of a particle from its nearest neighbour",
    )
    ax.legend(frameon=False, loc="lower left")
    return Verdict(
        every(_smaller(i) for i in (*own, *other)),
        worst,
        "times the distance (worst layer)",
        len(results),
        f"after the climb {words(own[0])} of before in the broadest layer, "
        f"{words(own[-1])} in the sharpest",
        table,
        [figures.save(figure, folder, "P0-3.png")],
    )


def _smaller(value: Interval) -> Finding:
    """Whether a ratio is below 1."""
    return not_worse(value, 1.0)


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
        _jobs,
        _judge,
    ),
)
