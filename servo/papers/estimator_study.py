"""Compares all estimators of the target's motion in closed loops: four motions of the target, at 30
and at 5 Hz.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from servo.estimators import KINDS as ESTIMATORS
from servo.papers.claim import Claim, Effort, Evidence, Rule, Verdict
from servo.papers.experiments import loop_job
from servo.papers.summaries import COLOURS, bars, column, group, panels
from servo.study.run import Job, grouped_by
from tracking.statistics.comparisons import Interval, mean_of
from tracking.statistics.verdicts import Finding

SEEDS = 10
BEST = "best"
RMS = "servo_rms_px"
PEAK = "servo_peak_px"
FAST = "30 Hz"
SLOW = "5 Hz"
LEGEND_FROM = 60.0
"""Upper end of the first axis [px], with space for the legend."""
LONG = ("run.duration=20.0", "measure.after=5.0")
AT = {FAST: (), SLOW: ("camera.rate=5.0", "controller.gain=1.0")}
"""Changes of a scenario for each rate; they keep lambda T below 1/4."""


TESTED = tuple(name for name in ESTIMATORS.names() if name != "integral")
"""All estimators but the integral, which is part of a law and estimates no motion."""


@dataclass(frozen=True, slots=True)
class Case:
    """A motion of the target at a frame rate: the scenario that has the motion, the changes of its
    settings, the compared measure of the servo error (rms or peak), and the largest allowed mean of
    this measure [px], by kind of the estimator ("best": of the best one).
    """

    motion: str
    rate: str
    scenario: str
    measure: str
    changes: tuple[str, ...]
    bounds: dict[str, float]
    """Largest error by estimator, or of the best one (`BEST`) [px]."""

    @property
    def title(self) -> str:
        """Return motion and kind of the measure as text, such as "sine rms" or "reversal peak"."""
        return f"{self.motion} {'peak' if self.measure == PEAK else 'rms'}"


CASES = (
    Case("constant", FAST, "line", RMS, (), {"kalman_cv": 1.5}),
    Case("reversal", FAST, "reversal", PEAK, (), {"kalman_cv": 9.0, BEST: 6.5}),
    Case("sine", FAST, "sine", RMS, (), {"kalman_cv": 4.0, BEST: 2.0}),
    Case("circle", FAST, "circle", RMS, (), {BEST: 2.0}),
    Case("constant", SLOW, "line", RMS, (*AT[SLOW], "measure.after=3.0"), {"kalman_cv": 3.0}),
    Case("reversal", SLOW, "reversal_5hz", PEAK, (), {"kalman_cv": 30.0, BEST: 25.0}),
    Case("sine", SLOW, "sine", RMS, (*AT[SLOW], *LONG), {"kalman_cv": 22.0, BEST: 12.0}),
    Case("circle", SLOW, "circle", RMS, (*AT[SLOW], *LONG), {BEST: 10.0}),
)
"""Bounds for f = 290 px, goal depth 1 m, one frame of latency, lambda 2 at 30 Hz and 1 at 5 Hz."""


def _jobs(effort: Effort) -> Sequence[Job]:
    """Return a run for each case, estimator and seed."""
    return [
        loop_job(
            case.scenario,
            estimator,
            seed,
            (*case.changes, *effort.changes),
            rate=case.rate,
            motion=case.motion,
        )
        for case in CASES
        for estimator in TESTED
        for seed in effort.seeds(SEEDS)
    ]


Scores = dict[str, list[Interval]]
"""Mean errors [px] with intervals in the order of `CASES`, by estimator."""


def _judge(evidence: Evidence) -> Verdict:
    """Return the verdict: the claim holds if all bounds of all cases are kept."""
    found: Scores = {
        estimator: [
            mean_of(column(group(runs, rate=case.rate, motion=case.motion), case.measure))
            for case in CASES
        ]
        for estimator, runs in grouped_by(
            evidence.records, lambda record: str(record.settings["estimator"])
        ).items()
    }
    missed = [text for i, case in enumerate(CASES) for text in _missed(found, i, case)]
    bounds = sum(len(case.bounds) for case in CASES)
    kept = bounds - len(missed)
    counted = f"{kept} of {bounds} bounds kept"
    return Verdict(
        Finding.DOES_NOT_HOLD if missed else Finding.HOLDS,
        Interval(kept, kept, kept),
        "bounds kept",
        bounds,
        f"{counted}; missed: {', '.join(missed)}" if missed else counted,
        _table(found),
        _draw({name: scores for name, scores in found.items() if name != "none"}),
    )


def _missed(found: Scores, i: int, case: Case) -> list[str]:
    """Return a text for each bound that the mean errors of a case miss; `i` is the case's index in
    `CASES`.
    """
    values = {name: intervals[i].value for name, intervals in found.items()}
    values[BEST] = min(value for name, value in values.items() if name != "true")  # known to it
    return [
        f"{case.title} at {case.rate}, {name}: {values[name]:.3g} px instead of {bound:g}"
        for name, bound in case.bounds.items()
        if not values[name] <= bound
    ]


def _table(found: Scores) -> list[list[str]]:
    """Return a table of the mean errors [px]: a row for each rate and estimator, and below the rows
    of a rate its bounds.
    """
    rows = [["px", "rate", *(c.title for c in CASES if c.rate == FAST)]]
    for rate in AT:
        chosen = [i for i, c in enumerate(CASES) if c.rate == rate]
        rows += [
            [
                name,
                rate,
                *(f"{s.value:.3g} ±{(s.high - s.low) / 2:.1g}" for s in (own[i] for i in chosen)),
            ]
            for name, own in found.items()
        ]
        for name in ("kalman_cv", BEST):
            bounds = (CASES[i].bounds.get(name) for i in chosen)
            rows.append([f"({name})", rate, *("" if b is None else f"<= {b:g}" for b in bounds)])
    return rows


def _draw(found: Scores) -> Figure:
    """Plot the mean errors [px] of estimators, and their bounds, by motion of the target, in one
    panel for each frame rate.
    """
    figure, both = panels(2, width=9.0)
    for ax, rate in zip(both, AT, strict=True):
        chosen = [i for i, c in enumerate(CASES) if c.rate == rate]
        for k, (name, scores) in enumerate(found.items()):
            at = np.arange(len(chosen)) + 0.1 * (k - (len(found) - 1) / 2)
            means, ends = bars([scores[i] for i in chosen])
            colour = COLOURS[k % len(COLOURS)]
            ax.errorbar(at, means, ends, fmt="o", ms=4, capsize=2, color=colour, label=name)
        for x, i in enumerate(chosen):
            ax.hlines(
                list(CASES[i].bounds.values()), x - 0.4, x + 0.4, color="#111111", lw=0.8, ls="--"
            )
        ax.set(xticks=range(len(chosen)), xticklabels=[CASES[i].title for i in chosen])
        ax.set(ylabel="distance [px]", yscale="log", title=f"{rate}; dashed: the bounds")
    both[0].set_ylim(top=LEGEND_FROM)
    both[0].legend(frameon=False, ncols=4)
    return figure


CLAIMS = (
    Claim(
        "estimators",
        "beyond the papers: how good each estimate of the target's motion is, by rate and motion",
        Rule(
            "servo rms, and peak at reversals",
            "our law, each estimator's defaults",
            f"bounds by motion and rate, on the mean of {SEEDS} seeds",
            "none",
            "none",
            "all bounds kept",
        ),
        _judge,
        _jobs,
    ),
)
