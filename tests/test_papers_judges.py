"""How each claim of the papers is judged, told and drawn from results that are made up."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from servo.bench.world_run import CONTESTANT
from servo.bench.world_score import ERROR as ERROR_SIZES
from servo.bench.world_score import LAST, PICTURE
from servo.loop.episode import run
from servo.loop.run_measures import summarise
from servo.papers import kams_paper, kernel_paper, texture_paper, tuning
from servo.papers.claim import Effort, Evidence
from servo.papers.claims import CLAIMS
from servo.papers.experiments import (
    ERROR,
    ESTIMATED,
    TIME,
    TRUE,
    EstimatedLoop,
    loop_job,
    registered,
)
from servo.scenario import load as scenarios
from servo.study.record_file import record_of, stored
from servo.study.run import Record
from servo.study.sequence_run import Generated
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


def measures(rng, worse):
    """Measures of one run; `worse` makes them larger."""
    error = float(worse * rng.uniform(1.0, 2.0))
    return {
        "angle_rmse_deg": error, "rmse_px": 2 * error, "mean_error_px": 1.5 * error,
        "milliseconds": 0.7 * error, "completed": float(error < 5.0), "auc": 1 / (1 + error),
        "scale_rmse": 0.05 * error, "frames_until_loss": round(120 / error),
        "evaluations": 100.0 * worse, "servo_rms_px": error, "servo_peak_px": 3 * error,
        "tilt_peak_deg": 2.0, "effort_rms_mm_s": 10 * worse, "effort_rms_deg_s": worse,
        "retreat_m": 0.1 * error, "camera_path_m": error, "end_position_mm": error,
        "end_rotation_deg": 0.5, "out_of_view_pct": 5.0 * (worse > 2),
    }  # fmt: skip


def results(claim, worse):
    """Made-up records of a claim on ten units; `worse` by tracker or estimator, else 1."""
    rng, found = np.random.default_rng(4), []
    for job in claim.jobs(QUICK):
        settings = dict(job.settings)
        who = next(settings[k] for k in ("estimator", "tracker", CONTESTANT) if k in settings)
        w = worse.get(who, 1.0)
        loop = isinstance(job.subject, EstimatedLoop)
        if not loop:
            settings |= {"family": job.subject.name, PICTURE: "", LAST: ""}
        for seed in range(UNITS.get(claim.name, 10)):
            over_time = series(rng, w) if loop else {ERROR_SIZES: np.zeros(2)}
            record = Record(
                subject=job.subject.name, seed=seed, settings=settings, outcome="CONVERGED",
                success=True, measures=measures(rng, w), versions={}, series=over_time,
            )  # fmt: skip
            found.append(record)
    return found


def series(rng, worse):
    """A target that turns round after two seconds; the error peaks there. In some runs the estimate
    turns a frame later, so that their shares of right signs differ.
    """
    time = np.arange(0, 4, 0.1)
    true = np.where(time < 2, 0.1, -0.1)
    late = worse * np.exp(-3 * np.abs(time - 2.2)) * 8
    noise = rng.uniform(0, 1, len(time))
    return {
        TIME: time,
        ERROR: late + noise,
        ESTIMATED: 0.9 * np.roll(true, round(10 * (worse - 1)) + (noise[0] < 0.5)),
        TRUE: np.array([np.nan, *true[1:]]),
    }


def surface(worse):
    """The verdict on distances that rise with angle and shift; not alike on both sides: a sign
    would show.
    """
    rng = np.random.default_rng(4)
    turned = np.abs(kernel_paper.TURNED_DEG)[:, None] / 300
    turned = turned * np.where(kernel_paper.TURNED_DEG < 0, 0.5, 1.0)[:, None]
    moved = np.abs(kernel_paper.MOVED_PX) / 100
    steep = {kernel_paper.ONE: np.ones(10), kernel_paper.NINE: 3 * worse.get("nine", 1.0)}
    steep[kernel_paper.NINE] = steep[kernel_paper.NINE] * rng.uniform(0.9, 1.1, 10)
    return kernel_paper.judged(
        {k: np.minimum(0.1 + s[:, None, None] * turned + moved, 1) for k, s in steep.items()}
    )


def neighbours(worse):
    before = np.tile([9.0, 7, 5, 4, 3], (10, 1))
    by = worse.get("after", 1.0) * np.random.default_rng(4).uniform(0.7, 0.8, (10, 1))
    return kams_paper.judged(before, by * before, before)


def likeness(worse):
    places = (texture_paper.FOUND, texture_paper.TRUTH, "5", "10", "20")
    rng = np.random.default_rng(4)
    rho = {p: rng.uniform(0.6, 0.62, (10, 40)) / worse.get(p, 1.0) for p in places}
    rho[texture_paper.FOUND][:5, 0] = 0.1  # the sequences differ
    return texture_paper.judged(rho)


COMPUTED = {"P0-3": neighbours, "P1-3": surface, "P2-2": likeness}
"""Judges of claims that are not about runs alone."""
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
    **dict.fromkeys(
        ("P1-10a", "P1-10b", "P1-11a", "P1-11b", "P1-13a", "P1-13b"),
        ({"difference": 2.0}, {"difference": 0.5}),
    ),
    **dict.fromkeys(
        ("P1-14a", "P1-14b", "P1-15a", "P1-15b"), ({"integral": 2.0}, {"integral": 0.5})
    ),
    **dict.fromkeys(("P1-12a", "P1-12b"), ({"integral": 4.0}, {})),
    **dict.fromkeys(("P3-1", "P3-1b"), ({"points": 5.0}, {})),
    **dict.fromkeys(("P3-2", "P3-2b"), ({"points": 20.0}, {"polar": 20.0})),
    "P3-3": ({"pose c*Mc": 20.0}, {"points": 20.0}),
    **dict.fromkeys(("P3-4", "P3-4b"), ({"pose c*Mc": 20.0}, {"pose cMo": 20.0})),
    **dict.fromkeys(("P3-5", "P3-6", "P3-6b"), ({"points": 20.0}, {"partitioned": 20.0})),
    "P2-1": (SHIFTED, {}),
    **dict.fromkeys(("P2-3", "P2-3b"), (dict.fromkeys(("texture-alone", "colour-alone"), 9.0), {})),
    "P2-2": ({"5": 1.2, "10": 1.3, "20": 1.5}, {texture_paper.FOUND: 1.5}),
}  # fmt: skip
"""What makes a claim hold, and what makes it fail: how much worse which tracker is."""


@pytest.fixture
def judged(tmp_path):
    """The verdict on a claim, from made-up results."""

    def of(name, worse):
        if name in COMPUTED:
            return COMPUTED[name](worse)
        claim = BY_NAME[name]
        return claim.judge(Evidence(results(claim, worse), QUICK, tmp_path))

    return of


painted = functools.cache(Generated.build)
"""Each sequence is painted once: a claim looks at it for each tracker."""


@pytest.fixture
def short(monkeypatch):
    """The sequences of the multi-kernel claims, with 20 frames."""
    entry = Generated("similarity", replace(kernel_paper.SIMILARITY.config, frames=20))
    monkeypatch.setattr(kernel_paper, "SIMILARITY", entry)
    monkeypatch.setattr(Generated, "build", painted)
    return entry


def plain(verdict, drawn):
    return {"verdict": replace(verdict, figure=None), "figure": drawn(verdict.figure)}


@pytest.mark.parametrize("name", VARIED)
@pytest.mark.newest
def test_a_claim_is_judged_from_its_results(name, approved, drawn, judged):
    held, failed = VARIED[name]
    verdict = judged(name, held)
    assert verdict.finding is Finding.HOLDS
    approved(f"papers/{name}", plain(verdict, drawn))
    assert judged(name, failed).finding is Finding.DOES_NOT_HOLD


@pytest.mark.parametrize("name", BY_NAME)
def test_every_claim_is_registered_and_tested_by_these_runs(name, approved):
    claim = BY_NAME[name]
    jobs = claim.jobs(Effort(quick=False, sequences=None))
    last = jobs[-1].key if jobs else None
    about = {"claim": claim.says, "rule": claim.rule, "jobs": len(jobs), "last": last}
    approved(f"papers/rule-{name}", about)


def test_undecided_is_what_the_interval_leaves_open(judged):
    verdict = judged("P0-1b", TUNED_POORLY)  # the hybrid is as good
    assert verdict.finding is Finding.UNDECIDED
    assert "against hybrid-tuned it is open or false" in verdict.measured
    assert verdict.effect.value == 0


def write_track(folder, label, name, sequence, off, seed=0):
    """The truth as a track, `off` pixels, degrees and percent away, in all frames or in each."""
    path = folder / "tracks" / label / f"{name}-{seed}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    file = TrackFile(path, sequence.region)
    off = np.broadcast_to(off, len(sequence.states))
    for k, (x, y, theta, scale) in enumerate(sequence.states):
        size = scale * np.exp(off[k] / 100)
        state = State(x + off[k], y, theta + np.radians(off[k]), size)
        estimate = Estimate(state, np.eye(4), 0.1, Status.LOCKED)
        file.add(Shot(Picture(f"{k}.png", k / 30, None), k, estimate, 0.002, (320, 240)))
    file.close()


def test_the_trackers_over_time(approved, drawn, short, tmp_path):
    claim = BY_NAME["P1-1"]
    found = results(claim, KERNELS)
    for i, label in enumerate(dict.fromkeys(r.settings["tracker"] for r in found)):
        write_track(tmp_path, label, "similarity", short.build(0), 1.0 + i)
    verdict = claim.judge(Evidence(found, QUICK, tmp_path))
    assert verdict.finding is Finding.HOLDS
    worse = results(claim, KERNELS | {"mk_pf-published": 0.3})
    assert claim.judge(Evidence(worse, QUICK, tmp_path)).finding is Finding.DOES_NOT_HOLD
    approved("papers/P1-1", plain(verdict, drawn))


@pytest.mark.parametrize(("percent", "finding"), [(-3, "HOLDS"), (3, "DOES_NOT_HOLD")])
def test_sizes_are_measured_where_motion_blurs_and_before(percent, finding, short, tmp_path):
    claim = BY_NAME["P1-9"]
    found = results(claim, {})
    grown = np.zeros(20)
    grown[7:12] = percent + 0.1 * np.arange(5)  # 35 to 60 % of the sequence
    grown[:7] = 1.0
    for r in found:
        write_track(
            tmp_path, r.settings["tracker"], "similarity", short.build(r.seed), grown, r.seed
        )
    verdict = claim.judge(Evidence(found, QUICK, tmp_path))
    assert verdict.finding is Finding[finding]
    assert verdict.effect.value == pytest.approx(percent + 0.2 - 1.0)
    assert verdict.table[1][1:] == [
        f"{percent + 0.2:.3g} % ({percent + 0.2:.3g} to {percent + 0.2:.3g})",
        "1 % (1 to 1)",
    ]


@pytest.mark.parametrize(
    ("lost", "finding"),
    [("", "HOLDS"), ("a", "DOES_NOT_HOLD"), ("d", "DOES_NOT_HOLD")],
)
def test_kams_has_to_complete_the_easy_levels_and_most_of_the_hardest(lost, finding, tmp_path):
    claim = BY_NAME["P0-2"]
    found = [
        replace(r, measures=r.measures | {"completed": float(r.settings["family"][-1] != lost)})
        for r in results(claim, {})
    ]
    assert claim.judge(Evidence(found, QUICK, tmp_path)).finding is Finding[finding]


def test_likeness_is_measured_at_the_filter_at_the_truth_and_beside_it(monkeypatch):
    entry = Generated("texture", replace(texture_paper.TEXTURE.config, frames=20, noise=0.0))
    monkeypatch.setattr(texture_paper, "TEXTURE", entry)
    track = entry.build(1000).states + [1.0, 0, 0, 0]
    found = texture_paper.coefficients(tuning.published("texture_pf"), 1000, track)
    means = {place: float(np.mean(values)) for place, values in found.items()}
    at = [
        texture_paper.FOUND,
        texture_paper.TRUTH,
        *(f"{n} px beside the truth" for n in (5, 10, 20)),
    ]
    assert list(found) == at
    assert {len(values) for values in found.values()} == {19}
    assert means[at[1]] > means[at[0]] > means[at[2]] > means[at[4]]


def test_the_job_of_a_closed_loop_keeps_its_series_whole(tmp_path):
    job = loop_job(
        "reversal", "kalman_cv", 2, ["run.duration=0.4", "measure.after=0.2"], way="short way"
    )
    assert job.key == "loop/shortway-reversal-kalman_cv-2"
    record = job.run(tmp_path)
    kept = record_of(*stored(record))
    changes = [registered("reversal"), "estimator.kind=kalman_cv", "run.duration=0.4"]
    changes.append("measure.after=0.2")
    scenario = scenarios.load("reversal", changes, 2)
    steps = list(run(scenario))
    summary = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    for found in (record, kept):
        assert found.series[TIME].tolist() == [s.frame.time for s in steps]
        assert found.series[ERROR].tolist() == [s.servo_error for s in steps]
        assert found.series[ESTIMATED].tolist() == [s.prediction.motion[1] for s in steps]
        assert found.series[TRUE][1:].tolist() == [s.target_motion_true[1] for s in steps[1:]]
        assert found.measures["servo_rms_px"] == summary.measures["servo_rms_px"]
        assert found.settings == {"estimator": "kalman_cv", "way": "short way"}


def test_the_tuning_marks_the_first_of_the_best_settings_and_writes_all_scores(tmp_path):
    claim = next(one for one in tuning.TUNING if one.name == "tuning-texture")
    jobs = claim.jobs(QUICK)
    assert len(jobs) == 2 * 6
    errors = iter([3.0, 2.0, 1.0, 1.0, 5.0, 4.0, 0.25, 0.12346, 0.5, 0.75, 1.0, 2.0])
    found = [replace(record, measures={"rmse_px": next(errors)}) for record in results_of(jobs)]
    verdict = claim.judge(Evidence(found, QUICK, tmp_path))
    head, *rows = verdict.table
    assert head == ["tracker", "settings", "rmse_px", ""]
    assert rows[0] == ["texture_pf", "noise 0.1, rest discard", "3", ""]
    assert [row[3] for row in rows] == ["", "", "best", "", "", "", "", "best", "", "", "", ""]
    assert rows[7][2] == "0.1235"
    assert verdict.finding is Finding.UNDECIDED
    written = tuning.TuningFile.read(tmp_path / "tuning.json")
    assert [score for _, score in written.scores["texture_ms"]] == [0.25, 0.1235, 0.5, 0.75, 1, 2]
    assert written.best("texture_pf") == {"noise": 0.25, "rest": "discard"}
    assert set(written.scores) == set(tuning.TUNED)


def results_of(jobs):
    """A made-up record of each job."""
    for job in jobs:
        yield Record(
            subject=job.subject.name, seed=0, settings=dict(job.settings), outcome="CONVERGED",
            success=True, measures={}, versions={}, series={},
        )  # fmt: skip
