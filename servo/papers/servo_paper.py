"""Claims of the multi-kernel paper, section VI: effect of estimating the target's motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from servo.batch.jobs import Job
from servo.papers.claim import COLOURS, Claim, Effort, Rule, Verdict, panels
from servo.papers.groups import Result, column, group, mean, mean_percent, ratio, words
from servo.papers.loop_series import LINE, REVERSAL, LoopSeries, varied
from tracking.drawing import figures
from tracking.statistics.comparisons import Interval, mean_of
from tracking.statistics.verdicts import greater, not_worse

SEEDS = 20
FIRST = 2000
"""Seeds 1000 to 1019 were run before, with draws that let the car drive through a toy: in the first
picture the toy was part of the target.
"""
NONE = "none"
FILTER = "kalman_cv"
ESTIMATORS = (NONE, FILTER)
LESS = 5.0
"""Least ratio of the errors without and with estimation; figure 10 of the paper shows more."""
SLOW = 0.02
"""The sign of the velocity is compared only above this true speed [m/s]."""
AGREE = 0.9
"""Least share of frames with the right sign."""
BACK_PX = 4.0
"""Distance below which the camera has recovered [px]."""


@dataclass(frozen=True, slots=True)
class Way:
    """How the claims about the loop are tested: as the paper prints it, or as it is here."""

    ending: str
    """Of the claims' names."""
    label: str
    settings: str
    changes: tuple[str, ...]
    after: dict[str, float]
    """When the errors begin to count [s], by scenario."""
    within: float
    """Longest time to recover after a reversal [s]."""


AS_PRINTED = Way(
    "a",
    "5Hz",
    "5 Hz, the law as printed: six degrees of freedom, four features fed forward",
    ("camera.rate=5.0", "controller.preset=paper"),
    {LINE: 3.0, REVERSAL: 5.0},
    2.0,
)
OURS = Way(
    "b",
    "30Hz",
    "30 Hz, our law: four degrees of freedom, two features fed forward",
    (),
    {LINE: 2.0, REVERSAL: 2.0},
    1.0,
)


def _jobs(way: Way, scenario: str, effort: Effort) -> Sequence[Job]:
    counts = f"measure.after={way.after[scenario]}"
    return [
        LoopSeries(scenario, e, s, (*way.changes, counts, *varied(scenario, s)), way.label)
        for e in ESTIMATORS
        for s in effort.seeds(SEEDS, FIRST)
    ]


def _table(results: list[Result]) -> list[list[str]]:
    """All measures by estimator; the sign counts where the car drives along the feature."""
    rows = [["estimator", "servo rms", "peak", "longest away", "right sign", "tilt, peak"]]
    for e in ESTIMATORS:
        runs = group(results, estimator=e)
        rows.append(
            [
                e,
                mean(runs, "servo_rms_px", "px"),
                mean(runs, "servo_peak_px", "px"),
                words(mean_of(np.array([_longest_away(r) for r in runs])), "s"),
                words(_agreements(runs), "%") if runs[0]["scenario"] == REVERSAL else "",
                mean(runs, "tilt_peak_deg", "deg"),
            ]
        )
    return rows


def _judge_lag(results: list[Result], folder: Path, name: str, way: Way) -> Verdict:
    del way
    without, found = (column(group(results, estimator=e), "servo_rms_px") for e in ESTIMATORS)
    times = ratio(without, found)
    figure = _draw_error(results, f"{name}: distance of the target from the goal, constant speed")
    return Verdict(
        greater(times, LESS),
        times,
        "times smaller",
        len(found),
        f"the error is {words(times)} times smaller with estimation",
        _table(results),
        [figures.save(figure, folder, f"{name}.png")],
    )


def _judge_sign(results: list[Result], folder: Path, name: str, way: Way) -> Verdict:
    del way
    runs = group(results, estimator=FILTER)
    share = _agreements(runs)
    figure, (ax,) = panels(1)
    ax.plot(runs[0]["time"], runs[0]["estimated"], color=COLOURS[2], label="estimated")
    ax.plot(runs[0]["time"][1:], runs[0]["true"][1:], "--", color=COLOURS[5], label="true")
    ax.set(
        xlabel="time [s]",
        ylabel="d yn/dt of the target [m/s]",
        title=f"{name}: the velocity follows the reversals ({_first_seed(runs)})",
    )
    ax.legend(frameon=False)
    return Verdict(
        greater(share, 100 * AGREE),
        share,
        "% of the frames",
        len(runs),
        f"right in {words(share, '%')} of the frames",
        _table(results),
        [figures.save(figure, folder, f"{name}.png")],
    )


def _first_seed(results: list[Result]) -> str:
    """Such as "seed 1000": of the run that is drawn alone, or thick."""
    return f"seed {results[0]['seed']}"


def _agreements(runs: list[Result]) -> Interval:
    return mean_percent(np.array([_agreement(r) for r in runs]))


def _agreement(run: Result) -> float:
    true = np.array([0.0 if v is None else v for v in run["true"]])
    fast = np.abs(true) > SLOW
    return float(np.mean(np.sign(run["estimated"])[fast] == np.sign(true[fast])))


def _judge_peak(results: list[Result], folder: Path, name: str, way: Way) -> Verdict:
    runs = group(results, estimator=FILTER)
    away = mean_of(np.array([_longest_away(r) for r in runs]))
    figure = _draw_error(results, f"{name}: distance of the target from the goal, reversals")
    return Verdict(
        not_worse(away, way.within),
        away,
        "s",
        len(runs),
        f"peak {mean(runs, 'servo_peak_px', 'px')}, below {BACK_PX:g} px again after "
        f"{words(away, 's')}",
        _table(results),
        [figures.save(figure, folder, f"{name}.png")],
    )


def _longest_away(run: Result) -> float:
    """Longest time in a row above `BACK_PX`, after the start [s]."""
    time = np.array(run["time"])
    error = np.array(run["servo_error"])
    settled = int(np.argmax(error < BACK_PX))
    longest = begin = 0.0
    for t, e in zip(time[settled:], error[settled:], strict=True):
        begin = t if e < BACK_PX else begin
        longest = max(longest, t - begin)
    return longest


def _draw_error(results: list[Result], title: str) -> Figure:
    figure, (ax,) = panels(1)
    for i, estimator in enumerate(ESTIMATORS):
        for k, run in enumerate(group(results, estimator=estimator)):
            look: dict[str, Any] = {"alpha": 0.2, "lw": 0.7} if k else {"label": estimator}
            ax.plot(run["time"], run["servo_error"], color=COLOURS[i], **look)
    most = max(max(r["servo_error"]) for r in results)
    ax.set(
        xlabel=f"time [s] (thick: {_first_seed(results)})",
        ylabel="distance [px]",
        title=title,
        ylim=(0, 1.25 * most),
    )
    ax.legend(frameon=False, ncols=2, loc="upper right")
    return figure


Judge = Callable[[list[Result], Path, str, Way], Verdict]


def _claim(number: int, way: Way, says: str, scenario: str, judge: Judge, rule: Rule) -> Claim:
    name = f"P1-{number}{way.ending}"
    return Claim(
        name, says, rule, lambda e: _jobs(way, scenario, e), lambda r, f: judge(r, f, name, way)
    )


UNITS = (
    f"{SEEDS} runs of {{}} with drawn start, heading, speed and reversals, clear of toys, seeds "
    f"from {FIRST} on"
)
MEAN = "95 % interval of the mean"


def _three(way: Way) -> tuple[Claim, ...]:
    line = UNITS.format("`line`")
    reversal = UNITS.format("`reversal`")
    return (
        _claim(
            4,
            way,
            "with Kalman estimation of the target's motion the camera no longer lags "
            "(figures 9, 10)",
            LINE,
            _judge_lag,
            Rule(
                "rms distance from the goal without estimation over that with it",
                way.settings,
                line,
                f"{LESS:g}",
                "95 % interval of the geometric mean ratio",
                f"above {LESS:g}",
            ),
        ),
        _claim(
            5,
            way,
            "the sign of the estimated velocity follows the car's reversals (figure 9)",
            REVERSAL,
            _judge_sign,
            Rule(
                "share of frames with the right sign of d yn/dt",
                way.settings,
                reversal,
                f"{100 * AGREE:g} %",
                MEAN,
                f"above {100 * AGREE:g} %",
            ),
        ),
        _claim(
            6,
            way,
            "at a reversal the error peaks and comes back (figures 10, 11)",
            REVERSAL,
            _judge_peak,
            Rule(
                f"longest time above {BACK_PX:g} px after the start",
                way.settings,
                reversal,
                f"{way.within:g} s",
                MEAN,
                f"below {way.within:g} s",
            ),
        ),
    )


CLAIMS = (*_three(AS_PRINTED), *_three(OURS))
