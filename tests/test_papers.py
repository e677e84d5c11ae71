"""`servobench papers`: one claim end to end, and how claims are judged."""

import json

import cv2
import numpy as np
import pytest

from servo.cli import main
from servo.papers import estimator_study, kams_paper, servo_paper
from servo.papers.claim import Effort
from servo.papers.claims import CLAIMS
from tracking.evaluation.statistics import Interval

NAMES = [
    "P0-1", "P0-2", "P0-3", "P1-1", "P1-2", "P1-3", "P1-4", "P1-5", "P1-6", "P2-1", "P2-2",
    "estimators",
]  # fmt: skip


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr("sys.argv", ["servobench", "papers", *arguments])
    with pytest.raises(SystemExit) as left:
        main.main()
    return left.value.code, *capfd.readouterr()


def test_every_claim_of_the_papers_is_there():
    assert [claim.name for claim in CLAIMS] == NAMES


def test_a_claim_is_run_told_drawn_and_written(monkeypatch, capfd, tmp_path):
    arguments = ["P1-3", "P0-3", "--quick", "--workers", "1", "--out", str(tmp_path)]
    code, out, err = call(monkeypatch, capfd, *arguments)
    assert (code, err) == (0, "")
    assert "P1-3 holds" in out
    written = json.loads((tmp_path / "papers.json").read_text())["claims"]
    assert list(written) == ["P1-3", "P0-3"]
    assert written["P1-3"]["holds"] is True
    for claim in written.values():
        assert cv2.imread(str(tmp_path / claim["figures"][0])).std() > 10


def test_an_unknown_claim_lists_what_there_is(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, err = call(monkeypatch, capfd, "P9-1")
    assert code == 2
    assert err == "servobench: papers: there is no claim 'P9-1'; did you mean 'P2-1'?\n"


def test_the_first_claim_has_all_six_trackers_on_sixty_sequences():
    jobs = kams_paper.CLAIMS[0].jobs(Effort(quick=False, sequences=None))
    labels = [job.contender.label for job in jobs]
    assert len(jobs) == labels.count("kams-paper") * len(set(labels))
    assert labels.count("kams-paper") >= 60
    assert len({job.key for job in jobs}) == len(jobs)


def test_equal_reads_are_equal():
    """Particles times layers of the rivals, and KAMS's 40 in 5 layers with some 5 reads each."""
    effort = Effort(quick=True, sequences=None)
    particles = {
        job.contender.label: job.contender.config.particles
        for job in kams_paper.CLAIMS[0].jobs(effort)
        if hasattr(job.contender.config, "particles")
    }
    assert particles == {
        "kams-paper": 40, "condensation-paper": 40, "annealed-paper": 40, "hybrid-paper": 100,
        "condensation-equal": 1000, "annealed-equal": 200, "hybrid-equal": 180,
    }  # fmt: skip


def frames(label, counts):
    return [
        {"tracker": label, "sequence": "s", "seed": i, "measures": {"frames_until_loss": float(n)}}
        for i, n in enumerate(counts)
    ]


@pytest.mark.parametrize(("losses", "holds"), [(0, True), (6, False)])
def test_the_first_claim_holds_only_against_all_five(tmp_path, losses, holds):
    ours = frames("kams-paper", [100] * 20)
    rivals = [r for k in kams_paper.BUDGET for r in frames(f"{k}-paper", [50] * 20)]
    rivals = [r for r in rivals if r["tracker"] != "sok-paper"]
    rivals += frames("sok-paper", [140] * losses + [100] * (11 - losses) + [50] * 9)
    rivals += [r for k in kams_paper.BUDGET for r in frames(f"{k}-equal", [100] * 20)]
    verdict = kams_paper.CLAIMS[0].judge([*ours, *rivals], tmp_path)
    assert verdict.holds is holds
    by_name = {row[0]: row for row in verdict.table}
    assert by_name["hybrid"][2:4] == [f"{19 / np.sqrt(20):.2f}", "20-0-0"]
    assert by_name["hybrid"][5:] == ["0.00", "0-0-20"]


def test_a_wrong_sign_is_found():
    true = [0.1] * 50 + [-0.1] * 50
    run = {"estimated": [0.09] * 60 + [-0.08] * 40, "true": [None, *true[1:]]}
    assert servo_paper._agreement(run) == pytest.approx(89 / 99)
    assert servo_paper._agreement(run | {"estimated": [-v for v in true]}) == pytest.approx(0.0)


def test_the_time_away_from_the_goal_is_the_longest_after_the_start():
    error = np.array([60, 20, 3, 2, 7, 8, 6, 2, 5, 1.0])
    run = {"time": (0.1 * np.arange(10)).tolist(), "servo_error": error.tolist()}
    assert servo_paper._longest_away(run) == pytest.approx(0.3)


def loops(scale):
    """Results of every estimator in every case, `scale` times its bound for kalman_cv."""
    return [
        {"scenario": job.scenario, "estimator": job.estimator, "seed": job.seed,
         "label": job.label,
         "measures": {c.measure: scale * (0.9 if job.estimator == "kalman_cv" else 0.5)
                      * max(c.bounds.values())}}
        for job in estimator_study.CLAIMS[0].jobs(Effort(quick=True, sequences=None))
        for c in estimator_study.CASES
        if (c.scenario, c.rate.replace(" ", "")) == (job.scenario, job.label)
    ]  # fmt: skip


def test_estimators_are_judged_by_their_bounds_rate_by_rate(tmp_path):
    kept = estimator_study.CLAIMS[0].judge(loops(1.0), tmp_path)
    assert kept.holds
    assert kept.measured == "12 of 12 bounds kept"
    missed = estimator_study.CLAIMS[0].judge(loops(1.2), tmp_path)
    assert not missed.holds
    assert "constant rms at 30 Hz, kalman_cv: 1.62 px instead of 1.5" in missed.measured
    rates = [row[1] for row in kept.table]
    assert rates.count("30 Hz") == rates.count("5 Hz") == 10  # eight estimators, two bounds
    assert cv2.imread(str(kept.figures[0])).std() > 10


def test_the_figure_of_estimators_leaves_out_the_one_that_estimates_nothing():
    found = {
        name: [Interval(1.0, 0.9, 1.1)] * len(estimator_study.CASES) for name in ("none", "jump")
    }
    legend = estimator_study._draw(found).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["jump"]
