"""Claims about estimating the target's motion: those of the multi-kernel paper, section VI, and the
claim that a Kalman filter does better than simpler methods (the raw difference of positions, an
integral of the error).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
    ratio,
    words,
)
from servo.study.run import Job, Record
from sim.types import Array
from tracking.statistics.comparisons import mean_of, mean_percent
from tracking.statistics.verdicts import greater, not_worse

SEEDS = 20
FIRST = 2000
"""First seed of the claims but those at equal terms. Seeds 1000 to 1019 were run before, with draws
that let the car drive through a toy: in the first picture the toy was part of the target.
"""
FILTER = "kalman_cv"
ESTIMATORS = ("none", FILTER)
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
    """Frame rate, control law and time limits of a test in the closed loop, those of the paper or
    servobench's own: changes of a scenario's settings, the time from which errors count by scenario
    (`after`) [s], and the longest time to recover after a reversal of the target (`within`) [s].
    """

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
    """Return the runs of several estimators of the target's motion in a scenario. With the same
    seed all estimators have the same random settings (`varied`).

    Args:
        scenario: Name of the scenario, "line" or "reversal".
        laws: For each estimator, its kind, and changes of the scenario's settings for its runs.
        changes: Changes of the scenario's settings for all runs, such as "camera.rate=5.0".
        rate: Label that distinguishes these runs from others of the same estimators.
        first: First seed, unless `effort` gives another one.
        effort: Options, such as a quick check, which decide the seeds.
    """
    return [
        loop_job(
            scenario,
            estimator,
            seed,
            [*changes, *settings, *varied(scenario, seed), *effort.changes],
            rate=rate,
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
    """Return the verdict on the claim P1-4 that the servo error is more than five times smaller
    with an estimate of the target's motion.
    """
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
    """Return the verdict on the claim P1-5 that the target's estimated velocity has the right sign
    in more than 90 % of the frames.
    """
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
    """Return the share, from 0 to 1, of frames in which estimated and true velocity have the same
    sign. Only frames with a true speed above 0.02 m/s count; without such frames it is nan.

    Args:
        estimated: Velocities (frames,) [m/s].
        true: Velocities (frames,) [m/s]; frames with nan, such as the first, do not count.
    """
    fast = np.abs(true) > SLOW
    return float(np.mean(np.sign(estimated)[fast] == np.sign(true)[fast]))


def _judge_peak(within: float, evidence: Evidence) -> Verdict:
    """Return the verdict on the claim P1-6 that after a reversal of the target the error is small
    again within a time [s].
    """
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
    """Return the longest time [s] in each run (n,) in which the error is not below 4 px, see
    `longest_away`.
    """
    return np.array([longest_away(r.series[TIME], r.series[ERROR]) for r in runs])


def longest_away(time: Array, error: Array) -> float:
    """Return the longest time [s] for which an error is not below 4 px, after it was below for the
    first time: from the last frame below to the last frame before it is below again. If it is never
    below 4 px, return the time of the last frame.

    Args:
        time: Times of the frames (n,) [s].
        error: Distances of the target from its goal in the image (n,) [px].
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
    """Return a text that names the independent observations of a claim's test, for its rule: runs
    of a scenario with random settings, with seeds from `first` on.
    """
    return (
        f"{SEEDS} runs of {scenario} with drawn start, heading, speed and reversals, clear of "
        f"toys, seeds from {first} on"
    )


def _three(conditions: Conditions) -> tuple[Claim, ...]:
    """Return the claims P1-4, P1-5 and P1-6 for a frame rate and a control law."""
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


@dataclass(frozen=True, slots=True)
class Rival:
    """An estimator of the target's motion that is compared with the Kalman filter: its kind, and
    changes of the scenario's settings for its runs (`settings`) and for those of the filter
    (`own`).
    """

    estimator: str
    """Kind of the estimator."""
    settings: tuple[str, ...] = ()
    """Changes of settings for the rival."""
    own: tuple[str, ...] = ()
    """Changes of settings for the filter in this comparison."""


DIFFERENCE = Rival("difference")
INTEGRAL = Rival("integral", ("estimator.gain=16.0",))
"""The gain with the smallest error of `reversal` on seeds 500 to 502, of 1, 4, 8, 16, 30."""
HARD = ("camera.noise=4.0", "camera.exposure=0.5", "run.tracker_ms=33.0")
CONDITIONS = (
    ("a", "", "plain", ()),
    ("b", "; noise of 4 grey levels, exposure 0.5, 33 ms of tracker", "hard", HARD),
)
"""Ending of a claim's name, text for its rule, label of its runs, and changes of the scenario."""
SMOOTHER = 1.5
"""Least ratio of control efforts that is called smoother."""
CLOSER = 2.0
"""Least ratio of errors that is called closer."""
AS_CLOSE = 0.1
"""Largest difference of errors that counts as equal [px]."""
EFFORT = "effort_rms_mm_s"
RMS = "servo_rms_px"
WHAT = {EFFORT: "control effort", RMS: "error"}
MORE = 1.1
"""Least ratio that is called larger."""
EQUAL = 0.9
"""Least share of the filter's value that counts as equal: comparing with a rival that has less of
both measures proves nothing."""
FRESH = 4000
"""First seed of the claims at equal terms (equal control effort or error): when these claims were
written, the runs of seeds from 2000 on were known. Their gains are those for which the filter's and
the rival's measure were nearly equal on seeds 500 to 502, of loop gains 1 to 8 for the filter, and
of integral gains 16 and 30 with loop gains 2, 3, 4 and 6."""
Judge = Callable[[Sequence[Record], Sequence[Record]], Verdict]
"""Function that returns the verdict on runs of the filter and a rival, without table and figure."""


def _judge(rival: Rival, judge: Judge, evidence: Evidence) -> Verdict:
    """Return the verdict of `judge` on the Kalman filter and a rival estimator, with a table and a
    figure.
    """
    runs = {e: group(evidence.records, estimator=e) for e in (FILTER, rival.estimator)}
    rows = [
        [e, mean(found, RMS, "px"), mean(found, EFFORT, "mm/s"), mean(found, "effort_rms_deg_s")]
        for e, found in runs.items()
    ]
    efforts = {e: mean_of(column(found, EFFORT)) for e, found in runs.items()}
    return replace(
        judge(*runs.values()),
        table=[["estimator", "servo rms", "change of commands", "of turns [deg/s]"], *rows],
        figure=intervals("control effort", "change from command to command [mm/s]", efforts),
    )


def _smoother(own: Sequence[Record], other: Sequence[Record]) -> Verdict:
    """Return the verdict on the claim that the Kalman filter (`own`) has more than 1.5 times
    smoother commands than a rival estimator (`other`), at an error that is at most 0.1 px larger.
    """
    times = ratio(column(other, EFFORT), column(own, EFFORT))
    worse = difference(own, other, RMS)
    return Verdict(
        every([greater(times, SMOOTHER), not_worse(worse, AS_CLOSE)]),
        times,
        "times smoother",
        len(own),
        f"commands change {words(times)} times less; the error is {words(worse, 'px')} larger",
    )


def _closer(own: Sequence[Record], other: Sequence[Record]) -> Verdict:
    """Return the verdict on the claim that a rival estimator (`other`) has more than twice the
    servo error of the Kalman filter (`own`).
    """
    times = ratio(column(other, RMS), column(own, RMS))
    rougher = ratio(column(own, EFFORT), column(other, EFFORT))
    return Verdict(
        greater(times, CLOSER),
        times,
        "times closer",
        len(own),
        f"the error is {words(times)} times smaller; commands change {words(rougher)} times as "
        "much",
    )


def _more(compared: str, equal: str, own: Sequence[Record], other: Sequence[Record]) -> Verdict:
    """Return the verdict on the claim that, compared with the Kalman filter (`own`), a rival
    estimator (`other`) has more than 1.1 times the value of the measure `compared`, and more than
    0.9 times that of the measure `equal`.
    """
    times = ratio(column(other, compared), column(own, compared))
    kept = ratio(column(other, equal), column(own, equal))
    return Verdict(
        every([greater(times, MORE), greater(kept, EQUAL)]),
        times,
        "times the filter's",
        len(own),
        f"{WHAT[compared]} {words(times)} times the filter's, {WHAT[equal]} {words(kept)} times",
    )


def _claims(
    number: int,
    scenario: str,
    rivals: Sequence[Rival],
    says: str,
    measure: str,
    margin: str,
    holds: str,
    judge: Judge,
    *,
    first: int = FIRST,
) -> list[Claim]:
    """Return a claim about the Kalman filter and a rival estimator twice: in plain conditions, and
    in hard ones.

    Args:
        number: Number of the claim, which is called P1-NUMBERa and P1-NUMBERb.
        scenario: Name of the scenario.
        rivals: The rival in plain and in hard conditions.
        says: The claim, in one sentence.
        measure: Measure of the rule.
        margin: Bound of the rule.
        holds: Condition of the rule.
        judge: Returns the verdict.
        first: First seed of the runs.
    """
    found: list[Claim] = []
    for rival, (ending, more, label, changes) in zip(rivals, CONDITIONS, strict=True):
        laws = ((FILTER, rival.own), (rival.estimator, rival.settings))
        settings = OURS.settings + more
        if first == FRESH:
            own, other = (", ".join(of) or "its defaults" for _, of in laws)
            settings += f"; {FILTER} with {own}, {rival.estimator} with {other}"
            label += f"equal{number}"  # apart from the other runs of the same estimators
        common = (*changes, f"measure.after={OURS.after[scenario]}")
        rule = Rule(measure, settings, units(f"`{scenario}`", first), margin, MEAN, holds)
        jobs = partial(loop_jobs, scenario, laws, common, label, first)
        found.append(Claim(f"P1-{number}{ending}", says, rule, partial(_judge, rival, judge), jobs))
    return found


def _smooth(number: int, scenario: str) -> list[Claim]:
    """Return the claim, in plain and in hard conditions, that the Kalman filter's commands are
    smoother than those from the raw difference of positions.
    """
    return _claims(
        number,
        scenario,
        (DIFFERENCE, DIFFERENCE),
        "the filter's commands are smoother than those of the raw difference, at an equal error",
        "change of the commanded velocity with the raw difference over that with the filter; rms "
        "error with the filter less that with the difference",
        f"{SMOOTHER:g}; {AS_CLOSE:g} px",
        f"above {SMOOTHER:g}, and the error at most {AS_CLOSE:g} px larger",
        _smoother,
    )


def _at_equal(
    number: int, equal: str, compared: str, says: str, rivals: Sequence[Rival]
) -> list[Claim]:
    """Return a claim, in plain and in hard conditions, that at an equal value of the measure
    `equal` a rival estimator has a larger value of the measure `compared` than the Kalman filter.
    """
    return _claims(
        number,
        REVERSAL,
        rivals,
        says,
        f"{WHAT[compared]} with the rival over that with the filter",
        f"{MORE:g}; {EQUAL:g} of the filter's {WHAT[equal]}",
        f"above {MORE:g}, and the rival's {WHAT[equal]} above {EQUAL:g} times the filter's",
        partial(_more, compared, equal),
        first=FRESH,
    )


CLAIMS = (
    *_three(AS_PRINTED),
    *_three(OURS),
    *_smooth(10, LINE),
    *_smooth(11, REVERSAL),
    *_claims(
        12,
        REVERSAL,
        (INTEGRAL, INTEGRAL),
        "the filter follows reversals more closely than a proportional-integral law",
        "rms error with the integral over that with the filter",
        f"{CLOSER:g}",
        f"above {CLOSER:g}",
        _closer,
    ),
    *_at_equal(
        13,
        EFFORT,
        RMS,
        "at an equal control effort the filter follows reversals more closely than the raw "
        "difference",
        (
            Rival("difference", own=("controller.gain=8.0",)),
            Rival("difference", own=("controller.gain=4.5",)),
        ),
    ),
    *_at_equal(
        14,
        EFFORT,
        RMS,
        "at an equal control effort the filter follows reversals more closely than a "
        "proportional-integral law",
        (
            Rival("integral", ("estimator.gain=30.0", "controller.gain=4.0")),
            Rival("integral", ("estimator.gain=16.0", "controller.gain=3.0")),
        ),
    ),
    *_at_equal(
        15,
        RMS,
        EFFORT,
        "at an equal error the filter's commands are smoother than those of a "
        "proportional-integral law",
        (
            Rival(
                "integral",
                ("estimator.gain=30.0", "controller.gain=6.0"),
                ("controller.gain=1.5",),
            ),
            Rival(
                "integral",
                ("estimator.gain=16.0", "controller.gain=6.0"),
                ("controller.gain=1.0",),
            ),
        ),
    ),
)
