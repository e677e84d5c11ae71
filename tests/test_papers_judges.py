"""How each claim of the papers is judged, told and drawn from results that are made up."""

import json
from dataclasses import replace

import numpy as np
import pytest

from servo.bench.sequence_jobs import Generated, track_path
from servo.loop.episode import run
from servo.loop.run_measures import summarise
from servo.papers import kernel_paper, texture_paper
from servo.papers.claim import Effort
from servo.papers.claims import CLAIMS
from servo.papers.servo_paper import LoopSeries
from servo.scenario import load as scenarios
from tracking.evaluation.drawing import figures as saving
from tracking.evaluation.sequences.sources import Picture
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import TrackFile
from tracking.types import Estimate, State, Status

BY_NAME = {claim.name: claim for claim in CLAIMS}
QUICK, FULL = Effort(quick=True, sequences=None), Effort(quick=False, sequences=None)
LOOPS = ("P1-4", "P1-5", "P1-6", "estimators")


@pytest.fixture
def figures(monkeypatch, drawn):
    """What is saved, instead of pictures: file name, dots an inch, and what it shows."""
    found = []

    def keep(figure, folder, name):
        found.append([name, drawn(figure)])
        return folder / name

    monkeypatch.setattr(saving, "save", keep)
    return found


def measures(rng, worse):
    """Measures of one run; `worse` makes them larger."""
    error = float(worse * rng.uniform(1.0, 3.0))
    return {
        "angle_rmse_deg": error, "rmse_px": 2 * error, "mean_error_px": 1.5 * error,
        "milliseconds": 0.7 * error, "completed": float(error < 5.0), "auc": 1 / (1 + error),
        "scale_rmse": 0.05 * error, "frames_until_loss": round(120 / error),
        "servo_rms_px": error, "servo_peak_px": 3 * error,
    }  # fmt: skip


def results(claim, worse):
    """Made-up results of three seeds of a claim; `worse` by tracker or estimator, else 1."""
    rng, found = np.random.default_rng(4), []
    for job in claim.jobs(QUICK):
        for seed in range(3):
            if isinstance(job, LoopSeries):
                of = {"scenario": job.scenario, "estimator": job.estimator, "label": job.label}
                of |= series(rng, worse.get(job.estimator, 1.0))
            else:
                label, entry = job.contender.label, job.entry
                of = {"tracker": label, "sequence": entry.name, "family": entry.name}
            name = of.get("estimator", of.get("tracker"))
            found.append(of | {"seed": seed, "measures": measures(rng, worse.get(name, 1.0))})
    return found


def series(rng, worse):
    """A target that turns round after two seconds; the error peaks there."""
    time = np.arange(0, 4, 0.1)
    true = np.where(time < 2, 0.1, -0.1)
    late = worse * np.exp(-3 * np.abs(time - 2.2)) * 8
    return {
        "time": time.tolist(), "servo_error": (late + rng.uniform(0, 1, len(time))).tolist(),
        "estimated": (0.9 * np.roll(true, round(10 * (worse - 1)))).tolist(),
        "true": [None, *true[1:].tolist()],
    }  # fmt: skip


@pytest.mark.parametrize("name", BY_NAME)
def test_every_claim_is_tested_by_these_runs(name, approved):
    jobs = BY_NAME[name].jobs(QUICK)
    keys = [job.key for job in BY_NAME[name].jobs(FULL)]
    assert len(set(keys)) == len(keys)
    described = {job.key: job.describe() for job in jobs if name not in LOOPS}
    changes = {job.key: [job.scenario, job.estimator, job.changes] for job in jobs
               if name in LOOPS}  # fmt: skip
    approved(f"papers/jobs-{name}", {
        "claim": BY_NAME[name].says, "all": len(keys), "last": keys[-1],
        "quick": changes or described,
    })  # fmt: skip


WORSE = {
    "P0-1": ({"kams-paper": 0.4}, {}), "P0-2": ({"sok-paper": 2.5, "kams": 0.6}, {"kams": 3.0}),
    "P1-2": ({"pf_ssd-paper": 0.3}, {}), "P1-4": ({"none": 9.0}, {"none": 2.0}),
    "P1-5": ({"none": 3.0}, {"kalman_cv": 2.0}), "P1-6": ({"none": 3.0}, {"kalman_cv": 6.0}),
    "P2-1": ({"texture_pf": 0.15}, {}),
}  # fmt: skip
"""What makes a claim hold, and what makes it fail."""


@pytest.mark.parametrize("name", WORSE)
@pytest.mark.parametrize("held", [True, False], ids=["as claimed", "otherwise"])
def test_a_claim_is_judged_from_its_results(name, held, approved, figures, tmp_path):
    worse = WORSE[name][0 if held else 1]
    verdict = BY_NAME[name].judge(results(BY_NAME[name], worse), tmp_path)
    assert bool(verdict.holds) is held
    told = {"measured": verdict.measured, "holds": verdict.holds, "table": verdict.table}
    assert [path.name for path in verdict.figures] == [f"{name}.png"]
    approved(f"papers/{name}-{'holds' if held else 'fails'}", told | {"figures": figures})


def test_three_claims_more_from_their_own_numbers(approved, figures, tmp_path):
    rng = np.random.default_rng(1)
    # Not alike on both sides: a sign in the judge would show.
    offsets = [np.abs(at) / most * np.where(at < 0, 0.5, 1.0) for at, most in
               ((kernel_paper.OFFSETS_DEG, 60), (kernel_paper.OFFSETS_PX, 50))]  # fmt: skip
    ways = {"one": (0.3, 0.1), "nine": (1.0, 0.02)}
    distances = [{who: [(a * o + b * k).tolist() for o in offsets] for who, (a, b) in ways.items()}
                 for k in range(3)]  # fmt: skip
    spreads = [{"spread": [[9, 7, 5, 4, 3], (np.array([7, 5, 3, 2, 1]) * k).tolist()]}
               for k in rng.uniform(0.8, 1.0, 3)]  # fmt: skip
    verdicts = [
        BY_NAME["P1-3"].judge(distances, tmp_path),
        BY_NAME["P0-3"].judge(spreads, tmp_path),
        BY_NAME["P1-3"].judge([{"one": d["nine"], "nine": d["one"]} for d in distances], tmp_path),
        BY_NAME["P0-3"].judge([{"spread": s["spread"][::-1]} for s in spreads], tmp_path),
    ]
    assert [v.holds for v in verdicts] == [True, True, False, False]
    told = [[v.measured, v.table, [path.name for path in v.figures]] for v in verdicts]
    approved("papers/P1-3-P0-3", told + figures)


def write_track(folder, label, name, sequence, off):
    """The truth as a track, `off` pixels and degrees away."""
    path = track_path(folder, f"{label}/{name}-0")
    path.parent.mkdir(parents=True, exist_ok=True)
    file = TrackFile(path, sequence.region)
    for k, (x, y, theta, scale) in enumerate(sequence.states):
        state = State(x + off, y, theta + np.radians(off), scale)
        estimate = Estimate(state, np.eye(4), 0.1, Status.LOCKED)
        file.add(Shot(Picture(f"{k}.png", k / 30, None), k, estimate, 0.002, (320, 240)))
    file.close()


def test_the_trackers_over_time(approved, figures, monkeypatch, tmp_path):
    entry = Generated("similarity", replace(kernel_paper.SIMILARITY.config, frames=12))
    monkeypatch.setattr(kernel_paper, "SIMILARITY", entry)
    claim = BY_NAME["P1-1"]
    worse = {"pf_ssd-paper": 0.3}
    found = results(claim, worse)
    for i, label in enumerate(dict.fromkeys(r["tracker"] for r in found)):
        write_track(tmp_path, label, "similarity", entry.build(0), 1.0 + i)
    verdict = claim.judge(found, tmp_path / "figures")
    assert verdict.holds
    assert not claim.judge(results(claim, {"mk_ssd-paper": 0.3}), tmp_path / "figures").holds
    approved("papers/P1-1", [verdict.measured, verdict.table, *figures])


def test_the_likeness_over_time(approved, figures, monkeypatch, tmp_path):
    entry = Generated("texture", replace(texture_paper.ENTRY.config, frames=12))
    monkeypatch.setattr(texture_paper, "ENTRY", entry)
    sequence = entry.build(0)
    for label, off in ((texture_paper.FILTER, 0.5), (texture_paper.SHIFT, 9.0)):
        write_track(tmp_path, label, "texture", sequence, off)
    found = [{"tracker": t, "seed": 0} for t in (texture_paper.FILTER, texture_paper.SHIFT)]
    verdict = BY_NAME["P2-2"].judge(found, tmp_path / "figures")
    assert verdict.holds
    approved("papers/P2-2", [verdict.measured, *figures], 1e-4)


def test_the_job_of_a_closed_loop_has_its_series(tmp_path):
    job = LoopSeries("reversal", "kalman_cv", 2, ("run.duration=0.4",), "short")
    assert job.key == "loop/reversal-short-kalman_cv-2"
    found = json.loads(json.dumps(job.run(tmp_path)))
    changes = ["estimator.kind=kalman_cv", "run.duration=0.4"]
    scenario = scenarios.load("reversal", changes, 2)
    steps = list(run(scenario))
    report = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    assert found["time"] == [s.frame.time for s in steps]
    assert found["servo_error"] == [s.servo_error for s in steps]
    assert found["estimated"] == [s.prediction.motion[1] for s in steps]
    assert found["true"][1:] == [s.target_motion_true[1] for s in steps[1:]]
    assert found["measures"]["servo_rms_px"] == report.value("servo_rms_px")
    assert (found["scenario"], found["estimator"], found["seed"], found["label"]) == (
        "reversal", "kalman_cv", 2, "short",
    )  # fmt: skip
    assert job.describe()["scenario"] == scenario.table
