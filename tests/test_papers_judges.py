"""How each claim of the papers is judged, told and drawn from results that are made up."""

import json
from dataclasses import replace

import numpy as np
import pytest

from servo.bench.sequence_jobs import Generated, SequenceJob, track_path
from servo.loop.episode import run
from servo.loop.run_measures import summarise
from servo.papers import kernel_jobs, kernel_paper, kernel_surface, texture_paper, tuning
from servo.papers.claim import Effort
from servo.papers.claims import CLAIMS
from servo.papers.experiments import Experiment
from servo.papers.kernel_jobs import Interleaved
from servo.papers.loop_series import LoopSeries
from servo.scenario import load as scenarios
from tracking.drawing import figures as saving
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import TrackFile
from tracking.sequences.sources import Picture
from tracking.statistics.verdicts import Finding
from tracking.types import Estimate, State, Status

BY_NAME = {claim.name: claim for claim in CLAIMS}
QUICK = Effort(quick=True, sequences=None)
UNITS = {"P1-2": 60}
"""Of the others ten."""


@pytest.fixture(autouse=True)
def _tuned(monkeypatch):
    """Other settings that are found best change no verdict of these tests."""
    scores = {name: [(s, 0.0) for s in one.grid] for name, one in tuning.TUNED.items()}
    file = tuning.TuningFile(scores=scores)
    monkeypatch.setattr(tuning, "stored", lambda: file)


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
    error = float(worse * rng.uniform(1.0, 2.0))
    return {
        "angle_rmse_deg": error, "rmse_px": 2 * error, "mean_error_px": 1.5 * error,
        "milliseconds": 0.7 * error, "completed": float(error < 5.0), "auc": 1 / (1 + error),
        "scale_rmse": 0.05 * error, "frames_until_loss": round(120 / error),
        "evaluations": 100.0 * worse, "servo_rms_px": error, "servo_peak_px": 3 * error,
        "tilt_peak_deg": 2.0, "size_blurred": 1.0 - 2 * worse + rng.uniform(0, 0.5),
        "size_before": rng.uniform(0, 0.5),
    }  # fmt: skip


def results(claim, worse):
    """Made-up results of a claim on ten units; `worse` by tracker, estimator or place, else 1."""
    rng, found = np.random.default_rng(4), []
    for job in claim.jobs(QUICK):
        for seed in range(UNITS.get(claim.name, 10)):
            if isinstance(job, LoopSeries):
                of = {"scenario": job.scenario, "estimator": job.estimator, "label": job.label}
                w = worse.get(job.estimator, 1.0)
                of |= series(rng, w) | {"measures": measures(rng, w)}
            elif isinstance(job, Interleaved):
                of = {"times": [1.0 + 0.01 * seed, 3.0]}
            elif isinstance(job, Experiment):
                of = {"surface": surfaces, "neighbours": neighbours}[job.name](rng, worse)
            elif isinstance(job, texture_paper.Likeness):
                of = {
                    p: (rng.uniform(0.6, 0.62, 40) / worse.get(p, 1.0)).tolist()
                    for p in ("filter", "0", "5", "10", "20")
                }
            else:
                inner = getattr(job, "job", job)
                label, entry = inner.contender.label, inner.entry
                of = {"tracker": label, "sequence": entry.name, "family": entry.name}
                of["measures"] = measures(rng, worse.get(label, 1.0))
            found.append(of | {"seed": seed})
    return found


def series(rng, worse):
    """A target that turns round after two seconds; the error peaks there."""
    time = np.arange(0, 4, 0.1)
    true = np.where(time < 2, 0.1, -0.1)
    late = worse * np.exp(-3 * np.abs(time - 2.2)) * 8
    return {
        "time": time.tolist(),
        "servo_error": (late + rng.uniform(0, 1, len(time))).tolist(),
        "estimated": (0.9 * np.roll(true, round(10 * (worse - 1)))).tolist(),
        "true": [None, *true[1:].tolist()],
    }


def surfaces(rng, worse):
    """Distances that rise with angle and shift; not alike on both sides: a sign would show."""
    turned = np.abs(kernel_surface.TURNED_DEG)[:, None] / 300
    turned = turned * np.where(kernel_surface.TURNED_DEG < 0, 0.5, 1.0)[:, None]
    moved = np.abs(kernel_surface.MOVED_PX) / 100
    steep = {"one": 1.0, "nine": 3 * worse.get("nine", 1.0) * rng.uniform(0.9, 1.1)}
    return {k: np.minimum(0.1 + s * turned + moved, 1).tolist() for k, s in steep.items()}


def neighbours(rng, worse):
    before, by = np.array([9, 7, 5, 4, 3]), worse.get("after", 1.0) * rng.uniform(0.7, 0.8)
    return {
        "with": [before.tolist(), (by * before).tolist()],
        "without": [before.tolist(), before.tolist()],
    }


POORLY = {
    f"{k}-published": 4.0 for k in ("condensation", "annealed", "hybrid", "mean_shift", "sok")
}
TUNED_POORLY = {f"{k}-tuned": 5.0 for k in tuning.TUNED if k not in ("kams", "hybrid")}
KERNELS = {"mk_pf-published": 2.2, "mk_pf-75-published": 3.0, "mk_ssd-published": 6.0}
FEW = {f"kams-{n}-particles": 9.0 for n in (12, 25)}
MANY = {
    f"{k}-{n}-particles": 9.0
    for k in ("annealed", "hybrid", "condensation")
    for n in (12, 25, 50, 100, 200)
}
SHIFTED = {f"texture_ms-{of}": 9.0 for of in ("published", "tuned")}
VARIED = {
    "P0-1a": (POORLY, {"kams-published": 9.0}),
    "P0-1b": (TUNED_POORLY | {"hybrid-tuned": 9.0}, {"kams-tuned": 9.0}),
    "P0-2": ({}, {"kams-published": 9.0}),
    "P0-3": ({}, {"after": 1.5}),
    "P0-4": (FEW | MANY, {f"kams-{n}-particles": 9.0 for n in (12, 25, 50)}),
    "P0-5": (dict.fromkeys(POORLY, 9.0), {"kams-published": 9.0}),
    "P0-6": ({"annealed-published": 9.0}, {"kams-3-layers": 9.0}),
    "P0-7": (FEW | MANY, {f"kams-{n}-particles": 9.0 for n in (12, 25, 50)}),
    "P0-8": (FEW | MANY, {k: v for k, v in MANY.items() if "-12-" in k}),
    "P1-2": (KERNELS, {"pf_ssd-published": 9.0}),
    "P1-3": ({}, {"nine": 0.3}),
    "P1-4a": ({"none": 9.0}, {"none": 2.0}),
    "P1-4b": ({"none": 9.0}, {"none": 2.0}),
    "P1-5a": ({}, {"kalman_cv": 2.0}),
    "P1-5b": ({}, {"kalman_cv": 2.0}),
    "P1-6a": ({}, {"kalman_cv": 300.0}),
    "P1-6b": ({}, {"kalman_cv": 6.0}),
    "P1-7": (KERNELS, {}),
    "P1-8": (KERNELS, {"mk_pf-published": 9.0}),
    "P1-9": ({}, {"pf_ssd-published": -2.0}),
    "P2-1": (SHIFTED, {}),
    **dict.fromkeys(("P2-3", "P2-3b"), (dict.fromkeys(("texture-alone", "colour-alone"), 9.0), {})),
    "P2-2": ({"5": 1.2, "10": 1.3, "20": 1.5}, {"filter": 1.5}),
}  # fmt: skip
"""What makes a claim hold, and what makes it fail: how much worse which tracker is."""


@pytest.mark.parametrize("name", VARIED)
def test_a_claim_is_judged_from_its_results(name, approved, figures, tmp_path):
    held, failed = VARIED[name]
    verdict = BY_NAME[name].judge(results(BY_NAME[name], held), tmp_path)
    assert verdict.finding is Finding.HOLDS
    assert [path.name for path in verdict.figures] == [f"{name}.png"]
    approved(f"papers/{name}", {"verdict": replace(verdict, figures=[]), "figures": figures})
    other = BY_NAME[name].judge(results(BY_NAME[name], failed), tmp_path)
    assert other.finding is Finding.DOES_NOT_HOLD


@pytest.mark.parametrize("name", BY_NAME)
def test_every_claim_is_registered_and_tested_by_these_runs(name, approved):
    claim = BY_NAME[name]
    jobs = claim.jobs(Effort(quick=False, sequences=None))
    approved(
        f"papers/rule-{name}",
        {
            "claim": claim.says,
            "rule": claim.rule,
            "jobs": len(jobs),
            "last": [jobs[-1].key, jobs[-1].describe()],
        },
    )


def test_undecided_is_what_the_interval_leaves_open(figures, tmp_path):
    claim = BY_NAME["P0-1b"]
    found = results(claim, TUNED_POORLY)  # the hybrid is as good
    verdict = claim.judge(found, tmp_path)
    assert verdict.finding is Finding.UNDECIDED
    assert "against hybrid-tuned it is open or false" in verdict.measured
    assert verdict.effect.value == 0


def write_track(folder, label, name, sequence, off, seed=0):
    """The truth as a track, `off` pixels and degrees away."""
    path = track_path(folder, f"{label}/{name}-{seed}")
    path.parent.mkdir(parents=True, exist_ok=True)
    file = TrackFile(path, sequence.region)
    for k, (x, y, theta, scale) in enumerate(sequence.states):
        state = State(x + off, y, theta + np.radians(off), scale * np.exp(off / 100))
        estimate = Estimate(state, np.eye(4), 0.1, Status.LOCKED)
        file.add(Shot(Picture(f"{k}.png", k / 30, None), k, estimate, 0.002, (320, 240)))
    file.close()


def test_the_trackers_over_time(approved, figures, monkeypatch, tmp_path):
    entry = Generated("similarity", replace(kernel_jobs.SIMILARITY.config, frames=20))
    monkeypatch.setattr(kernel_paper, "SIMILARITY", entry)
    claim = BY_NAME["P1-1"]
    found = results(claim, KERNELS)
    for i, label in enumerate(dict.fromkeys(r["tracker"] for r in found)):
        write_track(tmp_path, label, "similarity", entry.build(0), 1.0 + i)
    verdict = claim.judge(found, tmp_path / "figures")
    assert verdict.finding is Finding.HOLDS
    worse = claim.judge(results(claim, KERNELS | {"mk_pf-published": 0.3}), tmp_path / "figures")
    assert worse.finding is Finding.DOES_NOT_HOLD
    approved("papers/P1-1", {"verdict": replace(verdict, figures=[]), "figures": figures})


def test_sizes_are_measured_where_motion_blurs_and_before(monkeypatch, tmp_path):
    entry = Generated("similarity", replace(kernel_jobs.SIMILARITY.config, frames=20))
    job = SequenceJob(tuning.published("mk_ssd"), entry, 1000)
    sequence = entry.build(1000)

    def ran(self, folder):
        write_track(folder, self.contender.label, "similarity", sequence, 3.0, seed=1000)
        return {"measures": {}}

    monkeypatch.setattr(SequenceJob, "run", ran)
    found = kernel_jobs.Tracked(job).run(tmp_path)["measures"]
    assert found == {"size_blurred": pytest.approx(3.0), "size_before": pytest.approx(3.0)}


def test_likeness_is_measured_at_the_filter_at_the_truth_and_beside_it(tmp_path):
    entry = Generated("texture", replace(texture_paper.ENTRY.config, frames=20, noise=0.0))
    job = SequenceJob(tuning.published("texture_pf"), entry, 1000)
    found = texture_paper.Likeness(job).run(tmp_path)
    means = {place: float(np.mean(values)) for place, values in found.items()}
    assert list(found) == ["filter", "0", "5", "10", "20"]
    assert {len(values) for values in found.values()} == {19}
    assert means["0"] > means["5"] > means["20"]
    assert means["filter"] > means["20"]


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
    assert found["measures"]["servo_rms_px"] == report.measures["servo_rms_px"]
    assert [found[key] for key in ("estimator", "seed", "label")] == ["kalman_cv", 2, "short"]
    assert job.describe()["scenario"] == scenario.table
