"""Claims of the multi-kernel paper about trackers (Teuliere, Marchand, Eck): one kernel and nine;
deterministic, probabilistic, and combined.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.bench.sequence_jobs import track_path
from servo.papers.claim import COLOURS, Claim, Effort, Verdict, panels
from servo.papers.experiments import Experiment, contender, generated, sequence_jobs
from servo.papers.groups import Result, by_tracker, column, group, mean
from tracking.evaluation.drawing import figures
from tracking.evaluation.track_file import read

SEEDS, SEEDS_PAIR = 10, 30
THIRD = 1 / 3
OFFSETS_DEG, OFFSETS_PX = np.linspace(-45, 45, 61), np.linspace(-40, 40, 61)
AT_DEG = 15.0
"""Rotation at which one kernel and nine are compared."""
COMBINED, WHOLE = "pf_ssd-paper", "mk_pf-paper"
SIMILARITY = generated("similarity")


def _five(effort: Effort) -> Sequence[Job]:
    trackers = [contender(kind, "paper") for kind in ("kernel_pf", "mk_ssd", "mk_pf", "pf_ssd")]
    trackers.append(contender("mk_pf", "paper", "mk_pf-75-paper", particles=75))
    return sequence_jobs(trackers, [SIMILARITY], effort.seeds(SEEDS))


def _judge_five(results: list[Result], folder: Path) -> Verdict:
    table = [["tracker", "angle RMSE", "position RMSE", "never lost", "ms"]]
    middle: dict[str, float] = {}
    for label, runs in by_tracker(results).items():
        table.append([label, mean(runs, "angle_rmse_deg", "deg"), mean(runs, "rmse_px", "px"),
                      f"{int(column(runs, 'completed').sum())} of {len(runs)}",
                      f"{np.median(column(runs, 'milliseconds')):.2f}"])  # fmt: skip
        middle[label] = float(np.median(column(runs, "angle_rmse_deg")))
    best = min(middle, key=lambda n: middle[n])
    return Verdict(f"least median angle RMSE: {best}, {middle[best]:.2f} deg", best == COMBINED,
                   table, [_over_time(list(middle), folder)])  # fmt: skip


def _over_time(labels: Sequence[str], folder: Path) -> Path:
    """Draw errors of angle and position over one sequence, as figures 6 and 7; the file's path."""
    states = SIMILARITY.build(0).states
    assert states is not None
    figure, (above, below) = panels(2)
    for i, label in enumerate(labels):
        found = read(track_path(folder.parent, f"{label}/similarity-0")).states
        turned = np.degrees(np.abs(np.angle(np.exp(1j * (found[:, 2] - states[:, 2])))))
        above.plot(turned, color=COLOURS[i], lw=1.0, label=label)
        below.plot(np.hypot(*(found - states)[:, :2].T), color=COLOURS[i], lw=1.0)
    above.set(ylabel="angle error [deg]", ylim=(0, 30),
              title="P1-1: fast from 35 % on, hidden at 75 % of the sequence (seed 0)")  # fmt: skip
    below.set(ylabel="position error [px]", xlabel="frame", ylim=(0, 60))
    above.legend(frameon=False, ncols=3, fontsize=7)
    return figures.save(figure, folder, "P1-1.png")


def _pair(effort: Effort) -> Sequence[Job]:
    trackers = [contender(k, p) for p in ("paper", None) for k in ("mk_pf", "pf_ssd")]
    return sequence_jobs(trackers, [SIMILARITY], effort.seeds(SEEDS_PAIR))


def _judge_pair(results: list[Result], folder: Path) -> Verdict:
    table = [["settings", "tracker", "angle RMSE", "position RMSE", "median ms", "of the time"]]
    for ending, name in (("-paper", "paper's"), ("", "best known")):
        whole = column(group(results, tracker=f"mk_pf{ending}"), "milliseconds")
        for kind, count in (("mk_pf", 500), ("pf_ssd", 75)):
            runs = group(results, tracker=f"{kind}{ending}")
            ms = column(runs, "milliseconds")
            table.append([name, f"{kind} {count}", mean(runs, "angle_rmse_deg", "deg"),
                          mean(runs, "rmse_px", "px"), f"{np.median(ms):.2f}",
                          f"{np.median(ms / whole):.2f}"])  # fmt: skip
    ours, theirs = group(results, tracker=COMBINED), group(results, tracker=WHOLE)
    angle = [float(column(g, "angle_rmse_deg").mean()) for g in (ours, theirs)]
    times = column(ours, "milliseconds") / column(theirs, "milliseconds")
    figure, (ax,) = panels(1)
    for i, g in enumerate((ours, theirs)):
        ax.scatter(column(g, "milliseconds"), column(g, "angle_rmse_deg"), s=14, color=COLOURS[i],
                   label=g[0]["tracker"])  # fmt: skip
    ax.set(xlabel="median time of a frame [ms]", ylabel="angle RMSE [deg]", yscale="log",
           title="P1-2: one dot a seed", xlim=(0, None))  # fmt: skip
    ax.legend(frameon=False)
    return Verdict(
        f"angle RMSE {angle[0]:.2f} against {angle[1]:.2f} deg in {np.median(times):.2f} of the "
        f"time, papers' settings, {len(ours)} seeds",
        bool(angle[0] <= angle[1] and np.median(times) <= THIRD), table,
        [figures.save(figure, folder, "P1-2.png")],
    )  # fmt: skip


def _distances(seed: int) -> Result:
    """Distances around the true state over the rotations and over x, by number of kernels."""
    sequence = SIMILARITY.build(seed)
    image = next(iter(sequence.source)).image
    assert image is not None
    turned, moved = (np.tile(sequence.start.vector, (len(OFFSETS_PX), 1)) for _ in range(2))
    turned[:, 2] += np.radians(OFFSETS_DEG)
    moved[:, 0] += OFFSETS_PX
    found: Result = {}
    for kind, name in (("kernel_pf", "one"), ("mk_pf", "nine")):
        model = contender(kind, "paper").config.model(image, sequence.region, sequence.start)
        first = model.label(image)
        found[name] = [model.distances(first, states).tolist() for states in (turned, moved)]
    return found


def _third(effort: Effort) -> Sequence[Job]:
    about = {"sequence": SIMILARITY.describe()}
    return [Experiment("distance", about, _distances, s) for s in effort.seeds(SEEDS)]


def _judge_distance(results: list[Result], folder: Path) -> Verdict:
    figure, parts = panels(1, 2, 9.0)
    for i, name in enumerate(("one", "nine")):
        for ax, offsets, k in zip(parts, (OFFSETS_DEG, OFFSETS_PX), range(2), strict=True):
            mean = np.mean([r[name][k] for r in results], axis=0)
            ax.plot(offsets, mean, color=COLOURS[i], label=f"{name} kernel{'s' * i}")
    parts[0].set(xlabel="rotation [deg]", ylabel="Bhattacharyya distance", ylim=(0, 1))
    parts[1].set(xlabel="x [px]", ylim=(0, 1))
    parts[0].legend(frameon=False)
    at = int(np.argmin(np.abs(OFFSETS_DEG - AT_DEG)))
    middle = len(OFFSETS_DEG) // 2
    rise = {n: float(np.mean([r[n][0][at] - r[n][0][middle] for r in results]))
            for n in ("one", "nine")}  # fmt: skip
    return Verdict(
        f"at {AT_DEG:g} deg the distance rises by {rise['nine']:.2f} with nine kernels, by "
        f"{rise['one']:.2f} with one", bool(rise["nine"] > 2 * rise["one"]),
        figures=[figures.save(figure, folder, "P1-3.png")],
    )  # fmt: skip


CLAIMS = (
    Claim("P1-1", "through fast motion and total occlusion the combination is the most accurate "
          "in angle (figures 6, 7)",
          _five, _judge_five),
    Claim("P1-2", "75 particles with SSD are as accurate as 500 without, in a third of the time",
          _pair, _judge_pair),
    Claim("P1-3", "nine kernels see a rotation that one does not (figure 3)",
          _third, _judge_distance),
)  # fmt: skip
