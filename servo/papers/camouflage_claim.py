"""Claim of the PFJCTH paper: colour and texture together follow what neither does alone."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from servo.batch.jobs import Job
from servo.bench.sequence_jobs import Generated
from servo.papers.claim import COLOURS, FRESH, Claim, Effort, Rule, Verdict, every, panels
from servo.papers.experiments import contender, generated, sequence_jobs
from servo.papers.groups import Result, by_tracker, column, completed, mean, ratio, words
from tracking.drawing import figures
from tracking.settings import PLAIN
from tracking.statistics.verdicts import greater, not_worse

SEEDS = 30
LOSES = 50.0
"""Share of the sequences of which colour alone completes less [%]."""
JOINT = "joint"
TEXTURE = "texture-alone"
COLOUR = "colour-alone"
SPREAD = generated("camouflage", colours="spread", gravel=15)
ONE = generated("camouflage")
FOLLOWS = {"scale_noise": 0.03, "density": 24}
"""What the joint filter has too: the same search, on another histogram."""
TRACKERS = (
    contender("texture_pf", "paper", JOINT),
    contender("texture_pf", "paper", TEXTURE, levels=1),
    contender("condensation", None, COLOUR, **PLAIN, **FOLLOWS, scatter=0.0),
)


def _jobs(entry: Generated, effort: Effort) -> Sequence[Job]:
    return sequence_jobs(TRACKERS, [entry], effort.seeds(SEEDS))


def _judge(name: str, results: list[Result], folder: Path) -> Verdict:
    runs = by_tracker(results)
    rmse = {label: column(found, "rmse_px") for label, found in runs.items()}
    times = {label: ratio(rmse[label], rmse[JOINT]) for label in (TEXTURE, COLOUR)}
    done = {label: completed(found) for label, found in runs.items()}
    table = [["histogram", "RMSE", "over the joint one's", "completed [%]", "scale error"]]
    figure, (ax,) = panels(1)
    for i, (label, found) in enumerate(runs.items()):
        table.append(
            [
                label,
                mean(found, "rmse_px", "px"),
                words(times[label]) if label in times else "",
                words(done[label]),
                f"{100 * column(found, 'scale_rmse').mean():.0f} %",
            ]
        )
        at = i + np.linspace(-0.2, 0.2, len(found))
        ax.plot(at, rmse[label], ".", color=COLOURS[i])
    ax.set_xticks(range(len(runs)), list(runs))
    ax.set(
        ylabel="RMSE [px]",
        ylim=(0, None),
        title=f"{name}: a target in its ground's own colours, one dot a sequence",
    )
    nearest = min(times, key=lambda label: times[label].low)
    best = [greater(one, 1.0) for one in times.values()]
    return Verdict(
        every([*best, not_worse(done[COLOUR], LOSES)]),
        times[nearest],
        "times the joint histogram's RMSE",
        len(runs[JOINT]),
        f"colour alone completes {words(done[COLOUR], '%')}; the nearest is {nearest}",
        table,
        [figures.save(figure, folder, f"{name}.png")],
    )


def _claim(name: str, says: str, entry: Generated, target: str) -> Claim:
    return Claim(
        name,
        f"colour and texture together follow what neither follows alone: {says}",
        Rule(
            "RMSE of the centre with colour alone, and with texture alone, over that with both; "
            "sequences completed by colour alone",
            "the paper's preset; the same filter with one histogram or the other",
            f"{SEEDS} painted `camouflage` sequences, {target}, seeds from {FRESH} on",
            f"1; {LOSES:g} %",
            "95 % interval of the geometric mean ratio, and of the share",
            f"both ratios above 1, and colour completes less than {LOSES:g} %",
        ),
        partial(_jobs, entry),
        partial(_judge, name),
    )


CLAIMS = (
    _claim(
        "P2-3",
        "a target in a spread of its ground's colours",
        SPREAD,
        "whose target has a spread of its ground's own colours",
    ),
    _claim(
        "P2-3b",
        "a target in one colour with its ground",
        ONE,
        "whose target and ground have shades of one colour bin",
    ),
)
