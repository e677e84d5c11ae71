"""Claims of the multi-kernel paper, section VI: effect of estimating the target's motion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from servo.papers.claim import Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import ERROR, ESTIMATED, LINE, REVERSAL, TIME, TRUE, loop_job, varied
from servo.papers.summaries import (
    column,
    difference,
    group,
    intervals,
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
"""The sign of the velocity is compared only above this true speed [m/s]."""
AGREE = 0.9
"""Least share of frames with the right sign."""
BACK_PX = 4.0
"""Distance below which the camera has recovered [px]."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions of a test in the loop: those that the paper prints, or ours."""

    ending: str
    """Of the claims' names."""
    label: str
    settings: str
    changes: tuple[str, ...]
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


def _jobs(conditions: Conditions, scenario: str, effort: Effort) -> Sequence[Job]:
    counts = f"measure.after={conditions.after[scenario]}"
    return [
        loop_job(
            scenario,
            e,
            s,
            [*conditions.changes, counts, *varied(scenario, s)],
            rate=conditions.label,
        )
        for e in ESTIMATORS
        for s in effort.seeds(SEEDS, FIRST)
    ]


def _table(records: list[Record]) -> list[list[str]]:
    """Return all measures by estimator; the sign counts where the car drives along the feature."""
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
    """Return the share of frames (n,) in which the velocity has the right sign."""
    return np.array([agreement(r.series[ESTIMATED], r.series[TRUE]) for r in runs])


def agreement(estimated: Array, true: Array) -> float:
    """Return the share of the frames with a fast target in which both velocities (frames,) [m/s]
    have the same sign; the true one is nan in the first frame.
    """
    fast = np.abs(true) > SLOW
    return float(np.mean(np.sign(estimated)[fast] == np.sign(true)[fast]))


def _judge_peak(within: float, evidence: Evidence) -> Verdict:
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
    return np.array([longest_away(r.series[TIME], r.series[ERROR]) for r in runs])


def longest_away(time: Array, error: Array) -> float:
    """Return the longest time in a row in which the error [px] is above `BACK_PX`, after it has
    first been below [s].
    """
    settled = int(np.argmax(error < BACK_PX))
    longest = begin = 0.0
    for t, e in zip(time[settled:], error[settled:], strict=True):
        begin = t if e < BACK_PX else begin
        longest = max(longest, t - begin)
    return longest


def _draw_error(records: list[Record], title: str) -> Figure:
    """Draw the errors of the first run with each estimator."""
    first = [group(records, estimator=estimator)[0] for estimator in ESTIMATORS]
    curves = {r.settings["estimator"]: (r.series[TIME], r.series[ERROR]) for r in first}
    return lines(f"{title} (seed {first[0].seed})", "time [s]", "distance [px]", curves)


UNITS = (
    f"{SEEDS} runs of {{}} with drawn start, heading, speed and reversals, clear of toys, seeds "
    f"from {FIRST} on"
)
MEAN = "95 % interval of the mean"


def _three(conditions: Conditions) -> tuple[Claim, ...]:
    return (
        Claim(
            f"P1-4{conditions.ending}",
            "with Kalman estimation of the target's motion the camera no longer lags "
            "(figures 9, 10)",
            Rule(
                "rms distance from the goal without estimation over that with it",
                conditions.settings,
                UNITS.format("`line`"),
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
                UNITS.format("`reversal`"),
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
                UNITS.format("`reversal`"),
                f"{conditions.within:g} s",
                MEAN,
                f"below {conditions.within:g} s",
            ),
            partial(_judge_peak, conditions.within),
            partial(_jobs, conditions, REVERSAL),
        ),
    )


@dataclass(frozen=True, slots=True)
class Rival:
    """What could replace the filter."""

    estimator: str
    settings: tuple[str, ...] = ()


DIFFERENCE = Rival("difference")
INTEGRAL = Rival("integral", ("estimator.gain=16.0",))
"""The gain with the smallest error of `reversal` on seeds 500 to 502, of 1, 4, 8, 16, 30."""
HARD = ("camera.noise=4.0", "camera.exposure=0.5", "run.tracker_ms=33.0")
SMOOTHER = 1.5
"""Least ratio of control efforts that is called smoother."""
CLOSER = 2.0
"""Least ratio of errors that is called closer."""
AS_CLOSE = 0.1
"""Largest difference of errors that counts as equal [px]."""
EFFORT = "effort_rms_mm_s"
RMS = "servo_rms_px"


def _rival_jobs(rival: Rival, scenario: str, changes: Sequence[str], effort: Effort) -> list[Job]:
    label = "hard" if changes else "plain"
    common = [*changes, f"measure.after={OURS.after[scenario]}"]
    return [
        loop_job(scenario, e, s, [*common, *settings, *varied(scenario, s)], rate=label)
        for e, settings in ((FILTER, ()), (rival.estimator, rival.settings))
        for s in effort.seeds(SEEDS, FIRST)
    ]


def _judge_effort(rival: Rival, evidence: Evidence) -> Verdict:
    """Judge whether the filter's commands are smoother at an equal error."""
    own, other = (group(evidence.records, estimator=e) for e in (FILTER, rival.estimator))
    times = ratio(column(other, EFFORT), column(own, EFFORT))
    worse = difference(own, other, RMS)
    return Verdict(
        every([greater(times, SMOOTHER), not_worse(worse, AS_CLOSE)]),
        times,
        "times smoother",
        len(own),
        f"commands change {words(times)} times less; the error is {words(worse, 'px')} larger",
        _efforts(evidence.records),
        _draw_efforts(evidence.records),
    )


def _judge_closer(rival: Rival, evidence: Evidence) -> Verdict:
    """Judge whether the filter's error is smaller."""
    own, other = (group(evidence.records, estimator=e) for e in (FILTER, rival.estimator))
    times = ratio(column(other, RMS), column(own, RMS))
    rougher = ratio(column(own, EFFORT), column(other, EFFORT))
    return Verdict(
        greater(times, CLOSER),
        times,
        "times closer",
        len(own),
        f"the error is {words(times)} times smaller; commands change {words(rougher)} times as "
        "much",
        _efforts(evidence.records),
        _draw_efforts(evidence.records),
    )


def _efforts(records: Sequence[Record]) -> list[list[str]]:
    """Return errors and control efforts by estimator."""
    runs = {
        r.settings["estimator"]: group(records, estimator=r.settings["estimator"]) for r in records
    }
    rows = [
        [e, mean(found, RMS, "px"), mean(found, EFFORT, "mm/s"), mean(found, "effort_rms_deg_s")]
        for e, found in runs.items()
    ]
    return [["estimator", "servo rms", "change of commands", "of turns [deg/s]"], *rows]


def _draw_efforts(records: Sequence[Record]) -> Figure:
    found = {
        r.settings["estimator"]: mean_of(
            column(group(records, estimator=r.settings["estimator"]), EFFORT)
        )
        for r in records
    }
    return intervals("control effort", "change from command to command [mm/s]", found)


def _against(
    number: int,
    scenario: str,
    rival: Rival,
    says: str,
    measure: str,
    margin: str,
    holds: str,
    judge: Callable[[Rival, Evidence], Verdict],
) -> list[Claim]:
    """Return a claim about the filter and a rival, in plain and in hard conditions."""
    conditions = (
        ("a", "", ()),
        ("b", "; noise of 4 grey levels, exposure 0.5, 33 ms of tracker", HARD),
    )
    return [
        Claim(
            f"P1-{number}{ending}",
            says,
            Rule(measure, OURS.settings + more, UNITS.format(f"`{scenario}`"), margin, MEAN, holds),
            partial(judge, rival),
            partial(_rival_jobs, rival, scenario, changes),
        )
        for ending, more, changes in conditions
    ]


SMOOTH = (
    "the filter's commands are smoother than those of the raw difference, at an equal error",
    "change of the commanded velocity with the raw difference over that with the filter; rms "
    "error with the filter less that with the difference",
    f"{SMOOTHER:g}; {AS_CLOSE:g} px",
    f"above {SMOOTHER:g}, and the error at most {AS_CLOSE:g} px larger",
    _judge_effort,
)

CLAIMS = (
    *_three(AS_PRINTED),
    *_three(OURS),
    *_against(10, LINE, DIFFERENCE, *SMOOTH),
    *_against(11, REVERSAL, DIFFERENCE, *SMOOTH),
    *_against(
        12,
        REVERSAL,
        INTEGRAL,
        "the filter follows reversals more closely than a proportional-integral law",
        "rms error with the integral over that with the filter",
        f"{CLOSER:g}",
        f"above {CLOSER:g}",
        _judge_closer,
    ),
)
