"""Claims of the multi-kernel paper, section VI, about estimating the target's motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from servo.papers.claim import Claim, Effort, Evidence, Rule, Verdict
from servo.papers.experiments import ERROR, ESTIMATED, LINE, REVERSAL, TIME, TRUE, loop_job, varied
from servo.papers.summaries import (
    column,
    group,
    lines,
    mean,
    mean_percent,
    ratio,
    words,
)
from servo.study.run import Job, Record
from sim.types import Array
from tracking.statistics.comparisons import mean_of
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
"""Least true speed at which the sign of the velocity is compared [m/s]."""
AGREE = 0.9
"""Least share of frames with the right sign."""
BACK_PX = 4.0
"""Largest distance from the goal of a recovered camera [px]."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Rate and law of a test in the closed loop: those of the paper, or servobench's own."""

    ending: str
    """Ending of the claims' names."""
    label: str
    """Label that distinguishes the runs."""
    settings: str
    """Rate and law in words, for rules."""
    changes: tuple[str, ...]
    """Changes of a scenario."""
    after: dict[str, float]
    """Time from which the errors count [s], by scenario."""
    within: float
    """Longest time to recover after a reversal [s]."""


AS_PRINTED = Conditions(
    "a",
    "5Hz",
    "5 Hz, the law as printed: six degrees of freedom, four features fed forward",
    ("camera.rate=5.0", "controller.preset=paper"),
    {LINE: 3.0, REVERSAL: 5.0},
    2.0,
)
OURS = Conditions(
    "b",
    "30Hz",
    "30 Hz, our law: four degrees of freedom, two features fed forward",
    (),
    {LINE: 2.0, REVERSAL: 2.0},
    1.0,
)


def loop_jobs(
    scenario: str,
    laws: Sequence[tuple[str, Sequence[str]]],
    changes: Sequence[str],
    rate: str,
    first: int,
    effort: Effort,
) -> list[Job]:
    """Return the runs of estimators on the same draws of a scenario.

    Args:
        scenario: Its name.
        laws: Each estimator with its settings.
        changes: Changes of the scenario for all of them.
        rate: Label that distinguishes these runs from others of the same estimators.
        first: First seed.
        effort: The number of seeds.
    """
    return [
        loop_job(
            scenario, estimator, seed, [*changes, *settings, *varied(scenario, seed)], rate=rate
        )
        for estimator, settings in laws
        for seed in effort.seeds(SEEDS, first)
    ]


def _jobs(conditions: Conditions, scenario: str, effort: Effort) -> list[Job]:
    """Return the runs of a scenario without and with estimation."""
    changes = (*conditions.changes, f"measure.after={conditions.after[scenario]}")
    laws = [(estimator, ()) for estimator in ESTIMATORS]
    return loop_jobs(scenario, laws, changes, conditions.label, FIRST, effort)


def _table(records: list[Record]) -> list[list[str]]:
    """Return a table with a row for each estimator and its measures; the share of right signs is
    given only for a car that reverses.
    """
    runs = {e: group(records, estimator=e) for e in ESTIMATORS}
    reverses = records[0].subject == REVERSAL
    rows = [
        [
            e,
            mean(found, "servo_rms_px", "px"),
            mean(found, "servo_peak_px", "px"),
            words(mean_of(_away(found)), "s"),
            words(mean_percent(_agreement(found)), "%") if reverses else "",
            mean(found, "tilt_peak_deg", "deg"),
        ]
        for e, found in runs.items()
    ]
    return [["estimator", "servo rms", "peak", "longest away", "right sign", "tilt, peak"], *rows]


def _judge_lag(evidence: Evidence) -> Verdict:
    """Return the verdict on P1-4: the error is smaller with estimation."""
    records = evidence.records
    without, found = (column(group(records, estimator=e), "servo_rms_px") for e in ESTIMATORS)
    times = ratio(without, found)
    return Verdict(
        greater(times, LESS),
        times,
        "times smaller",
        len(found),
        f"the error is {words(times)} times smaller with estimation",
        _table(records),
        _draw_error(records, "distance of the target from the goal, constant speed"),
    )


def _judge_sign(evidence: Evidence) -> Verdict:
    """Return the verdict on P1-5: the estimated velocity has the right sign."""
    runs = group(evidence.records, estimator=FILTER)
    share = mean_percent(_agreement(runs))
    first = runs[0]
    time = first.series[TIME]
    return Verdict(
        greater(share, 100 * AGREE),
        share,
        "% of the frames",
        len(runs),
        f"right in {words(share, '%')} of the frames",
        _table(evidence.records),
        lines(
            f"the velocity follows the reversals (seed {first.seed})",
            "time [s]",
            "d yn/dt of the target [m/s]",
            {
                "estimated": (time, first.series[ESTIMATED]),
                "true": (time[1:], first.series[TRUE][1:]),
            },
        ),
    )


def _agreement(runs: list[Record]) -> Array:
    """Return for each run (n,) the share of frames, from 0 to 1, whose estimated velocity has the
    right sign.
    """
    return np.array([agreement(r.series[ESTIMATED], r.series[TRUE]) for r in runs])


def agreement(estimated: Array, true: Array) -> float:
    """Return the share, from 0 to 1, of the frames with a fast target in which estimated and true
    velocity have the same sign.

    Args:
        estimated: Velocities (frames,) [m/s].
        true: Velocities (frames,) [m/s]; nan in the first frame.
    """
    fast = np.abs(true) > SLOW
    return float(np.mean(np.sign(estimated)[fast] == np.sign(true)[fast]))


def _judge_peak(within: float, evidence: Evidence) -> Verdict:
    """Return the verdict on P1-6: after a reversal the error is small again within a time [s]."""
    runs = group(evidence.records, estimator=FILTER)
    away = mean_of(_away(runs))
    return Verdict(
        not_worse(away, within),
        away,
        "s",
        len(runs),
        f"peak {mean(runs, 'servo_peak_px', 'px')}, below {BACK_PX:g} px again after "
        f"{words(away, 's')}",
        _table(evidence.records),
        _draw_error(evidence.records, "distance of the target from the goal, reversals"),
    )


def _away(runs: list[Record]) -> Array:
    """Return the longest time [s] of each run (n,) with a large error; see `longest_away`."""
    return np.array([longest_away(r.series[TIME], r.series[ERROR]) for r in runs])


def longest_away(time: Array, error: Array) -> float:
    """Return the longest uninterrupted time [s] in which the error is not below `BACK_PX`, after it
    has been below once.

    Args:
        time: Times of the frames (n,) [s].
        error: Distances from the goal (n,) [px].
    """
    settled = int(np.argmax(error < BACK_PX))
    longest = begin = 0.0
    for t, e in zip(time[settled:], error[settled:], strict=True):
        begin = t if e < BACK_PX else begin
        longest = max(longest, t - begin)
    return longest


def _draw_error(records: list[Record], title: str) -> Figure:
    """Plot the errors [px] of the first run with each estimator over time [s]."""
    first = [group(records, estimator=estimator)[0] for estimator in ESTIMATORS]
    curves = {r.settings["estimator"]: (r.series[TIME], r.series[ERROR]) for r in first}
    return lines(f"{title} (seed {first[0].seed})", "time [s]", "distance [px]", curves)


MEAN = "95 % interval of the mean"


def units(scenario: str, first: int = FIRST) -> str:
    """Return the text of a rule about its units: runs of a scenario with drawn settings."""
    return (
        f"{SEEDS} runs of {scenario} with drawn start, heading, speed and reversals, clear of "
        f"toys, seeds from {first} on"
    )


def _three(conditions: Conditions) -> tuple[Claim, ...]:
    """Return the claims P1-4, P1-5 and P1-6 with a rate and a law."""
    return (
        Claim(
            f"P1-4{conditions.ending}",
            "with Kalman estimation of the target's motion the camera no longer lags "
            "(figures 9, 10)",
            Rule(
                "rms distance from the goal without estimation over that with it",
                conditions.settings,
                units("`line`"),
                f"{LESS:g}",
                "95 % interval of the geometric mean ratio",
                f"above {LESS:g}",
            ),
            _judge_lag,
            partial(_jobs, conditions, LINE),
        ),
        Claim(
            f"P1-5{conditions.ending}",
            "the sign of the estimated velocity follows the car's reversals (figure 9)",
            Rule(
                "share of frames with the right sign of d yn/dt",
                conditions.settings,
                units("`reversal`"),
                f"{100 * AGREE:g} %",
                MEAN,
                f"above {100 * AGREE:g} %",
            ),
            _judge_sign,
            partial(_jobs, conditions, REVERSAL),
        ),
        Claim(
            f"P1-6{conditions.ending}",
            "at a reversal the error peaks and comes back (figures 10, 11)",
            Rule(
                f"longest time above {BACK_PX:g} px after the start",
                conditions.settings,
                units("`reversal`"),
                f"{conditions.within:g} s",
                MEAN,
                f"below {conditions.within:g} s",
            ),
            partial(_judge_peak, conditions.within),
            partial(_jobs, conditions, REVERSAL),
        ),
    )


CLAIMS = (*_three(AS_PRINTED), *_three(OURS))
