"""Claims that estimating the target's motion does better than simpler laws: the raw difference of
positions, and an integral of the error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from servo.papers.claim import Claim, Evidence, Rule, Verdict, every
from servo.papers.experiments import LINE, REVERSAL
from servo.papers.servo_paper import FILTER, FIRST, MEAN, OURS, loop_jobs, units
from servo.papers.summaries import column, difference, group, intervals, mean, ratio, words
from servo.study.run import Record
from tracking.statistics.comparisons import mean_of
from tracking.statistics.verdicts import greater, not_worse


@dataclass(frozen=True, slots=True)
class Rival:
    """An estimator that is compared with the Kalman filter."""

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
"""First seed of the claims at equal terms: the runs from 2000 on were known when they were written.
The gains are a pair whose measures were nearly alike on seeds 500 to 502, of loop gains 1 to 8 for
the filter, and of 16 and 30 with loop gains 2, 3, 4, 6 for the integral."""
Judge = Callable[[Sequence[Record], Sequence[Record]], Verdict]
"""Function that returns the verdict on runs of the filter and a rival, without table and figure."""


def _judge(rival: Rival, judge: Judge, evidence: Evidence) -> Verdict:
    """Return the verdict of `judge` on the filter and a rival, with a table and a figure."""
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
    """Return the verdict on the claim that the filter (`own`) has smoother commands than a rival
    (`other`) at an equal error.
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
    """Return the verdict on the claim that the filter (`own`) has a smaller error than a rival."""
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
    """Return the verdict on the claim that a rival (`other`) has a larger value of a measure
    (`compared`) than the filter (`own`), and at least an equal value of another (`equal`).
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
    """Return a claim about the filter and a rival in plain conditions, and in hard ones.

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
    """Return the claim, in both conditions, that the filter's commands are smoother than those of
    the raw difference.
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
    """Return a claim, in both conditions, on the filter and a rival whose measure `equal` is alike,
    while the measure `compared` is larger for the rival.
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
