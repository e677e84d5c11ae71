"""Claims about estimating the target's motion against simpler laws that might do as well: the raw
difference and an integral.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from matplotlib.figure import Figure

from servo.papers.claim import Claim, Effort, Evidence, Rule, Verdict, every
from servo.papers.experiments import LINE, REVERSAL, loop_job, varied
from servo.papers.servo_paper import FILTER, FIRST, MEAN, OURS, SEEDS, units
from servo.papers.summaries import column, difference, group, intervals, mean, ratio, words
from servo.study.run import Job, Record
from tracking.statistics.comparisons import mean_of
from tracking.statistics.verdicts import greater, not_worse


@dataclass(frozen=True, slots=True)
class Rival:
    """What could replace the filter."""

    estimator: str
    settings: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    """The filter's settings beside it."""
    label: str = ""
    """Of the runs, where others have the same estimators."""
    first: int = FIRST
    """First seed."""


DIFFERENCE = Rival("difference")
INTEGRAL = Rival("integral", ("estimator.gain=16.0",))
"""The gain with the smallest error of `reversal` on seeds 500 to 502, of 1, 4, 8, 16, 30."""
HARD = ("camera.noise=4.0", "camera.exposure=0.5", "run.tracker_ms=33.0")
CONDITIONS = (
    ("a", "", ()),
    ("b", "; noise of 4 grey levels, exposure 0.5, 33 ms of tracker", HARD),
)
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
"""Least ratio that is called more."""
EQUAL = 0.9
"""Least share of the filter's that counts as equal: a rival that is spared proves nothing."""
FRESH = 4000
"""First seed of the claims at equal terms: the runs from 2000 on were known when they were written.
The gains are a pair whose measures were nearly alike on seeds 500 to 502, of loop gains 1 to 8 for
the filter, and of 16 and 30 with loop gains 2, 3, 4, 6 for the integral."""


def _jobs(rival: Rival, scenario: str, changes: Sequence[str], effort: Effort) -> list[Job]:
    common = [*changes, f"measure.after={OURS.after[scenario]}"]
    label = "hard" if changes else "plain"
    return [
        loop_job(
            scenario,
            e,
            s,
            [*common, *settings, *varied(scenario, s)],
            rate=f"{label}{rival.label}",
        )
        for e, settings in ((FILTER, rival.own), (rival.estimator, rival.settings))
        for s in effort.seeds(SEEDS, rival.first)
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
        _table(evidence.records),
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
        _table(evidence.records),
        _draw_efforts(evidence.records),
    )


def _judge_at_equal(rival: Rival, compared: str, equal: str, evidence: Evidence) -> Verdict:
    """Judge whether a rival has more of one measure where it has as much of another."""
    own, other = (group(evidence.records, estimator=e) for e in (FILTER, rival.estimator))
    times = ratio(column(other, compared), column(own, compared))
    kept = ratio(column(other, equal), column(own, equal))
    return Verdict(
        every([greater(times, MORE), greater(kept, EQUAL)]),
        times,
        "times the filter's",
        len(own),
        f"{WHAT[compared]} {words(times)} times the filter's, {WHAT[equal]} {words(kept)} times",
        _table(evidence.records),
        _draw_efforts(evidence.records),
    )


def _table(records: Sequence[Record]) -> list[list[str]]:
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
    return [
        Claim(
            f"P1-{number}{ending}",
            says,
            Rule(
                measure,
                OURS.settings + more,
                units(f"`{scenario}`", rival.first),
                margin,
                MEAN,
                holds,
            ),
            partial(judge, rival),
            partial(_jobs, rival, scenario, changes),
        )
        for ending, more, changes in CONDITIONS
    ]


SMOOTH = (
    "the filter's commands are smoother than those of the raw difference, at an equal error",
    "change of the commanded velocity with the raw difference over that with the filter; rms "
    "error with the filter less that with the difference",
    f"{SMOOTHER:g}; {AS_CLOSE:g} px",
    f"above {SMOOTHER:g}, and the error at most {AS_CLOSE:g} px larger",
    _judge_effort,
)


def _gain(gain: float) -> str:
    return f"controller.gain={gain}"


def _integral(gain: float) -> str:
    return f"estimator.gain={gain}"


def _at_equal(
    number: int, equal: str, compared: str, says: str, rivals: Sequence[Rival]
) -> list[Claim]:
    """Return a claim about the filter and a rival at an equal measure, in both conditions."""
    named = [replace(rival, label=f"equal{number}", first=FRESH) for rival in rivals]
    return [
        Claim(
            f"P1-{number}{ending}",
            says,
            Rule(
                f"{WHAT[compared]} with the rival over that with the filter",
                f"{OURS.settings}{more}; {FILTER} with {', '.join(rival.own) or 'its defaults'}, "
                f"{rival.estimator} with {', '.join(rival.settings) or 'its defaults'}",
                units("`reversal`", FRESH),
                f"{MORE:g}; {EQUAL:g} of the filter's {WHAT[equal]}",
                MEAN,
                f"above {MORE:g}, and the rival's {WHAT[equal]} above {EQUAL:g} times the filter's",
            ),
            partial(_judge_at_equal, rival, compared, equal),
            partial(_jobs, rival, REVERSAL, changes),
        )
        for rival, (ending, more, changes) in zip(named, CONDITIONS, strict=True)
    ]


CLAIMS = (
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
    *_at_equal(
        13,
        EFFORT,
        RMS,
        "at an equal control effort the filter follows reversals more closely than the raw "
        "difference",
        (
            Rival("difference", own=(_gain(8.0),)),
            Rival("difference", own=(_gain(4.5),)),
        ),
    ),
    *_at_equal(
        14,
        EFFORT,
        RMS,
        "at an equal control effort the filter follows reversals more closely than a "
        "proportional-integral law",
        (
            Rival("integral", (_integral(30.0), _gain(4.0))),
            Rival("integral", (_integral(16.0), _gain(3.0))),
        ),
    ),
    *_at_equal(
        15,
        RMS,
        EFFORT,
        "at an equal error the filter's commands are smoother than those of a "
        "proportional-integral law",
        (
            Rival("integral", (_integral(30.0), _gain(6.0)), (_gain(1.5),)),
            Rival("integral", (_integral(16.0), _gain(6.0)), (_gain(1.0),)),
        ),
    ),
)
