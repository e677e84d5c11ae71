"""Claims of the multi-kernel paper, section VI: effect of estimating the target's motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from servo.batch.jobs import Job
from servo.loop.episode import measured_run
from servo.papers.claim import COLOURS, Claim, Effort, Verdict, panels
from servo.papers.groups import Result, column, group, mean, words
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from sim.types import Array
from tracking.evaluation.drawing import figures
from tracking.evaluation.statistics import bootstrap
from tracking.files.json_text import number

ALONG = "yn"
"""The feature along which the car of `reversal` drives back and forth."""
SEEDS = 5
ESTIMATORS = ("none", "kalman_cv")
LESS = 5.0
"""Least ratio of the errors without and with estimation; figure 10 of the paper shows more."""
SLOW = 0.02
"""The sign of the velocity is compared only above this true speed [m/s]."""
AGREE, WITHIN = 0.9, 1.0
"""Least share of frames with the right sign, and longest time to recover after a reversal [s]."""
BACK_PX = 4.0
"""Distance below which the camera has recovered [px]."""


@dataclass(frozen=True, slots=True)
class LoopSeries:
    """A job: one scenario in the closed loop with one estimator and one seed."""

    scenario: str
    estimator: str
    seed: int
    changes: tuple[str, ...] = ()
    """As with --set."""
    label: str = ""
    """Distinguishes jobs that differ in `changes` only."""

    @property
    def key(self) -> str:
        parts = [self.scenario, self.label, self.estimator, str(self.seed)]
        return "loop/" + "-".join(filter(None, parts))

    def describe(self) -> dict[str, Any]:
        return {"scenario": self._scenario().table}

    def run(self, folder: Path) -> Result:
        """Measures, and errors and velocities over time."""
        del folder
        steps, report = measured_run(self._scenario())
        along = steps[0].scene.features.names.index(ALONG)
        return {
            "scenario": self.scenario, "estimator": self.estimator, "seed": self.seed,
            "label": self.label,
            "measures": {m.name: number(m.value) for m in report.measures},
            "time": [s.frame.time for s in steps],
            "servo_error": [s.servo_error for s in steps],
            "estimated": [float(s.prediction.motion[along]) for s in steps],
            "true": [number(float(s.target_motion_true[along])) for s in steps],
        }  # fmt: skip

    def _scenario(self) -> Scenario:
        changes = [f"estimator.kind={self.estimator}", *self.changes]
        return scenarios.load(self.scenario, changes, self.seed)


def _both(name: str, effort: Effort) -> Sequence[Job]:
    return [LoopSeries(name, e, s) for e in ESTIMATORS for s in effort.seeds(SEEDS)]


def _judge_lag(results: list[Result], folder: Path) -> Verdict:
    runs = {e: group(results, estimator=e) for e in ESTIMATORS}
    without, with_estimate = (column(runs[e], "servo_rms_px").mean() for e in ESTIMATORS)
    times = float(without / with_estimate)
    table = [["estimator", "servo rms"], *([e, mean(runs[e], "servo_rms_px", "px")] for e in runs)]
    figure = _draw_error(results, "P1-4: distance of the target from the goal, constant speed")
    return Verdict(f"{times:.0f} times smaller with estimation", times >= LESS, table,
                   [figures.save(figure, folder, "P1-4.png")])  # fmt: skip


def _judge_sign(results: list[Result], folder: Path) -> Verdict:
    runs = group(results, estimator="kalman_cv")
    shares = np.array([_agreement(r) for r in runs])
    figure, (ax,) = panels(1)
    ax.plot(runs[0]["time"], runs[0]["estimated"], color=COLOURS[2], label="estimated")
    ax.plot(runs[0]["time"][1:], runs[0]["true"][1:], "--", color=COLOURS[5], label="true")
    ax.set(xlabel="time [s]", ylabel="d yn/dt of the target [m/s]",
           title="P1-5: the estimated velocity follows the reversals")  # fmt: skip
    ax.legend(frameon=False)
    said = f"right in {words(bootstrap(100 * shares), '%')} of the frames"
    return Verdict(
        said, bool(shares.mean() >= AGREE), figures=[figures.save(figure, folder, "P1-5.png")]
    )


def _agreement(run: Result) -> float:
    true = np.array([0.0 if v is None else v for v in run["true"]])
    fast = np.abs(true) > SLOW
    return float(np.mean(np.sign(run["estimated"])[fast] == np.sign(true[fast])))


def _judge_peak(results: list[Result], folder: Path) -> Verdict:
    runs = group(results, estimator="kalman_cv")
    back = max(_longest_away(r) for r in runs)
    figure = _draw_error(results, "P1-6: distance of the target from the goal, reversals")
    return Verdict(
        f"peak {mean(runs, 'servo_peak_px', 'px')}, below {BACK_PX:g} px again after {back:.2f} s",
        back <= WITHIN, figures=[figures.save(figure, folder, "P1-6.png")],
    )  # fmt: skip


def _longest_away(run: Result) -> float:
    """Longest time in a row above `BACK_PX`, after the start [s]."""
    time, error = np.array(run["time"]), np.array(run["servo_error"])
    settled = int(np.argmax(error < BACK_PX))
    longest = begin = 0.0
    for t, e in zip(time[settled:], error[settled:], strict=True):
        begin = t if e < BACK_PX else begin
        longest = max(longest, t - begin)
    return longest


def _draw_error(results: list[Result], title: str) -> Figure:
    figure, (ax,) = panels(1)
    for i, estimator in enumerate(ESTIMATORS):
        runs = group(results, estimator=estimator)
        error: Array = np.array([r["servo_error"] for r in runs])
        ax.plot(runs[0]["time"], error.mean(axis=0), color=COLOURS[i], label=estimator)
        ax.fill_between(runs[0]["time"], error.min(axis=0), error.max(axis=0), color=COLOURS[i],
                        alpha=0.2, lw=0)  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="distance [px]", title=title, ylim=(0, None))
    ax.legend(frameon=False)
    return figure


CLAIMS = (
    Claim("P1-4", "with Kalman estimation of the target's motion the camera no longer lags "
          "(figures 9, 10)", lambda e: _both("line", e), _judge_lag),
    Claim("P1-5", "the sign of the estimated velocity follows the car's reversals (figure 9)",
          lambda e: _both("reversal", e), _judge_sign),
    Claim("P1-6", "at a reversal the error peaks and comes back (figures 10, 11)",
          lambda e: _both("reversal", e), _judge_peak),
)  # fmt: skip
