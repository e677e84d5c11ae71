"""Claim of the multi-kernel paper: nine kernels see a rotation that one does not (figure 3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.papers.claim import COLOURS, FRESH, Claim, Effort, Rule, Verdict, panels
from servo.papers.experiments import Experiment, contender
from servo.papers.groups import Result, ratio, words
from servo.papers.kernel_jobs import SIMILARITY
from sim.types import Array
from tracking.drawing import figures
from tracking.statistics.verdicts import greater

SEEDS = 30
TURNED_DEG = np.linspace(-90, 90, 37)
MOVED_PX = np.linspace(-40, 40, 33)
AT_DEG = 15.0
TIMES = 2.0
"""Rotation at which the slopes are compared, and their least ratio."""
ONE = "one"
NINE = "nine"
MODELS = {ONE: contender("kernel_pf", "paper"), NINE: contender("mk_pf", "paper")}


def _surfaces(seed: int) -> Result:
    """Distances (angles, shifts) around the true state, by number of kernels."""
    sequence = SIMILARITY.build(seed)
    image = next(iter(sequence.source)).image
    assert image is not None
    states = np.tile(sequence.start.vector, (len(TURNED_DEG), len(MOVED_PX), 1))
    states[..., 2] += np.radians(TURNED_DEG)[:, None]
    states[..., 0] += MOVED_PX
    found: Result = {}
    for name, tracker in MODELS.items():
        model = tracker.config.model(image, sequence.region, sequence.start)
        distances = model.distances(model.label(image), states.reshape(-1, 4))
        found[name] = distances.reshape(states.shape[:2]).tolist()
    return found


def _jobs(effort: Effort) -> Sequence[Job]:
    about = {
        "sequence": SIMILARITY.describe(),
        "kernels": {k: c.describe() for k, c in MODELS.items()},
    }
    return [Experiment("surface", about, _surfaces, s) for s in effort.seeds(SEEDS)]


def _slopes(surfaces: Array) -> Array:
    """Mean rise (n,) of the distance to 15 deg on both sides [1/deg], without a shift."""
    along = surfaces[:, :, len(MOVED_PX) // 2]
    sides = [int(np.argmin(np.abs(TURNED_DEG - a))) for a in (-AT_DEG, AT_DEG)]
    return (along[:, sides].mean(axis=1) - along[:, len(TURNED_DEG) // 2]) / AT_DEG


def _judge(results: list[Result], folder: Path) -> Verdict:
    found = {k: np.array([r[k] for r in results]) for k in MODELS}
    slopes = {k: _slopes(v) for k, v in found.items()}
    times = ratio(slopes[NINE], slopes[ONE])
    figure, parts = panels(2, 2, 9.0)
    for i, (name, surface) in enumerate(found.items()):
        mean = surface.mean(axis=0)
        ax = parts[i]
        kernels = f"{name} kernel{'s' * i}"
        shown = ax.contourf(MOVED_PX, TURNED_DEG, mean, np.linspace(0, 1, 21), cmap="viridis")
        ax.set(xlabel="x [px]", ylabel="rotation [deg]", title=kernels)
        figure.colorbar(shown, ax=ax, label="distance", ticks=[0, 0.5, 1])
        parts[2].plot(TURNED_DEG, mean[:, len(MOVED_PX) // 2], color=COLOURS[i], label=kernels)
        parts[3].plot(MOVED_PX, mean[len(TURNED_DEG) // 2], color=COLOURS[i])
    parts[2].set(xlabel="rotation [deg]", ylabel="distance", ylim=(0, 1))
    parts[3].set(xlabel="x [px]", ylabel="distance", ylim=(0, 1))
    parts[2].legend(frameon=False, loc="lower right")
    return Verdict(
        greater(times, TIMES),
        times,
        "times the slope of one kernel",
        len(results),
        f"slope at {AT_DEG:g} deg with nine kernels {words(times)} times that with one",
        figures=[figures.save(figure, folder, "P1-3.png")],
    )


CLAIMS = (
    Claim(
        "P1-3",
        "nine kernels see a rotation that one does not (figure 3)",
        Rule(
            f"rise of the distance from 0 to {AT_DEG:g} deg with nine kernels, over that with one",
            "the papers' presets",
            f"first pictures of {SEEDS} painted `similarity` sequences, seeds from {FRESH} on",
            f"{TIMES:g}",
            "95 % interval of the geometric mean ratio",
            f"above {TIMES:g}",
        ),
        _jobs,
        _judge,
    ),
)
