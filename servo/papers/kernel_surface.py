"""Claim of the multi-kernel paper: nine kernels see a rotation that one does not (figure 3)."""

import numpy as np
from matplotlib.figure import Figure

from servo.papers.claim import FRESH, Claim, Evidence, Rule, Verdict
from servo.papers.drawing import COLOURS, panels
from servo.papers.experiments import contender, generated
from servo.papers.groups import ratio, words
from sim.types import Array
from tracking.statistics.verdicts import greater

SEEDS = 30
TURNED_DEG = np.linspace(-90, 90, 37)
MOVED_PX = np.linspace(-40, 40, 33)
AT_DEG = 15.0
"""Rotation at which the slopes are compared."""
LEAST_RATIO = 2.0
ONE = "one kernel"
NINE = "nine kernels"
MODELS = {ONE: contender("kernel_pf", "paper"), NINE: contender("mk_pf", "paper")}


def surfaces(seed: int) -> dict[str, Array]:
    """Return distances (angles, shifts) around the true state in the first picture of a sequence,
    by number of kernels.
    """
    sequence = generated("similarity").build(seed)
    image = next(iter(sequence.source)).image
    assert image is not None
    states = np.tile(sequence.start.vector, (len(TURNED_DEG), len(MOVED_PX), 1))
    states[..., 2] += np.radians(TURNED_DEG)[:, None]
    states[..., 0] += MOVED_PX
    found: dict[str, Array] = {}
    for name, tracker in MODELS.items():
        model = tracker.config.model(image, sequence.region, sequence.start)
        distances = model.distances(model.label(image), states.reshape(-1, 4))
        found[name] = distances.reshape(states.shape[:2])
    return found


def _judge(evidence: Evidence) -> Verdict:
    found = [surfaces(seed) for seed in evidence.effort.seeds(SEEDS)]
    return judged({name: np.array([one[name] for one in found]) for name in MODELS})


def judged(found: dict[str, Array]) -> Verdict:
    """Return the verdict on surfaces (sequences, angles, shifts), by number of kernels."""
    slopes = {name: _slopes(surface) for name, surface in found.items()}
    times = ratio(slopes[NINE], slopes[ONE])
    return Verdict(
        greater(times, LEAST_RATIO),
        times,
        "times the slope of one kernel",
        len(found[NINE]),
        f"slope at {AT_DEG:g} deg with nine kernels {words(times)} times that with one",
        figure=_draw({name: surface.mean(axis=0) for name, surface in found.items()}),
    )


def _slopes(surface: Array) -> Array:
    """Return the mean rise (n,) of the distance to `AT_DEG` on both sides [1/deg], unshifted."""
    along = surface[:, :, len(MOVED_PX) // 2]
    sides = [int(np.argmin(np.abs(TURNED_DEG - a))) for a in (-AT_DEG, AT_DEG)]
    return (along[:, sides].mean(axis=1) - along[:, len(TURNED_DEG) // 2]) / AT_DEG


def _draw(means: dict[str, Array]) -> Figure:
    figure, (*maps, turned, moved) = panels(2, 2, 9.0)
    for ax, (name, mean), colour in zip(maps, means.items(), COLOURS, strict=False):
        shown = ax.contourf(MOVED_PX, TURNED_DEG, mean, np.linspace(0, 1, 21), cmap="viridis")
        ax.set(xlabel="x [px]", ylabel="rotation [deg]", title=name)
        figure.colorbar(shown, ax=ax, label="distance", ticks=[0, 0.5, 1])
        turned.plot(TURNED_DEG, mean[:, len(MOVED_PX) // 2], color=colour, label=name)
        moved.plot(MOVED_PX, mean[len(TURNED_DEG) // 2], color=colour)
    turned.set(xlabel="rotation [deg]", ylabel="distance", ylim=(0, 1))
    moved.set(xlabel="x [px]", ylabel="distance", ylim=(0, 1))
    turned.legend(frameon=False, loc="lower right")
    return figure


CLAIMS = (
    Claim(
        "P1-3",
        "nine kernels see a rotation that one does not (figure 3)",
        Rule(
            f"rise of the distance from 0 to {AT_DEG:g} deg with nine kernels, over that with one",
            "the papers' presets",
            f"first pictures of {SEEDS} painted `similarity` sequences, seeds from {FRESH} on",
            f"{LEAST_RATIO:g}",
            "95 % interval of the geometric mean ratio",
            f"above {LEAST_RATIO:g}",
        ),
        _judge,
    ),
)
