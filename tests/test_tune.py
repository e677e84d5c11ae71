"""`servobench tune`: the search, its aim and its settings, and what the command writes."""

import json

import numpy as np
import pytest

from servo.cli import report_command, tune_command
from servo.mistake import Mistake
from servo.report.tune_section import Tuned
from servo.report.words import NOTHING
from servo.scenario.draws import Draw, flat
from servo.scenario.load import load
from servo.tune import search as search_module
from servo.tune import space
from servo.tune.search import Aim, Candidate, Condition, check_budget, search

BEST = 0.739085
"""The product of gain and delay at which the integral of e^2 of e' = -g e(t - d) is smallest: x = cos x."""
FREE = ("robot.kind=free", "tracker.kind=truth", "run.duration=0.5", "measure.after=0.2")
QUICK = {"minimise": "servo_rms_px", "budget": 10, "seeds": 2, "fresh": 2}
QUICK |= {"workers": 1, "scheduler": None, "quiet": True}


def integrator(asked):
    """Runs of the integrator with delay: a cost and an effort, each with noise that the seed draws."""
    rows = []
    for settings, seed in asked:
        x = settings.get("gain", 0.2)
        noise = 1 + 0.3 * np.random.default_rng(seed).normal()
        cost = np.cos(x) / (2 * x * (1 - np.sin(x))) if x < np.pi / 2 else 1e3 * x
        rows.append({"servo_rms_px": cost + noise, "effort_rms_mm_s": 10 * x, "success_rate": 1.0})
    return rows


def found(aim, budget=300, seeds=range(1, 9), perform=integrator):
    draws = [Draw("gain", "log_uniform", (0.02, 2.0))]
    return search(aim, draws, perform, seeds, budget)


def test_the_best_gain_of_an_integrator_with_delay_is_found():
    tried, best = found(Aim.read("servo_rms_px", ()))
    assert best.settings["gain"] == pytest.approx(BEST, rel=0.05)
    assert sum(len(one.runs) for one in tried) <= 300
    assert len(tried) > 60  # of 37 without races
    assert {len(one.runs) for one in tried} == {2, 4, 8} or {len(one.runs) for one in tried} == {
        2,
        8,
    }


def test_a_condition_bounds_the_gain():
    _, best = found(Aim.read("servo_rms_px", ["effort_rms_mm_s<=5"]))
    assert 0.45 < best.settings["gain"] <= 0.5


def test_where_nothing_keeps_the_conditions_the_nearest_is_found():
    aim = Aim.read("servo_rms_px", ["effort_rms_mm_s<=0.1"])
    _, best = found(aim, 100)
    broken, _ = aim.score(best.runs)
    assert broken > 0
    assert best.settings["gain"] < 0.03


def test_the_same_search_gives_the_same_candidates():
    aim = Aim.read("servo_rms_px", ())
    first, second = ([one.settings for one in found(aim, 60)[0]] for _ in range(2))
    assert first == second


def test_equal_runs_use_one_seed():
    done = []

    def perform(asked):
        done.extend(asked)
        return integrator([(s, 0) for s, _ in asked])

    tried, _ = found(Aim.read("servo_rms_px", ()), 50, perform=perform)
    assert {len(one.runs) for one in tried} == {1}
    assert len(done) == 50  # two of them with the settings as they are


def test_runs_without_a_value_are_the_worst():
    aim = Aim.read("servo_rms_px", ["success_rate>=0.5"])
    good, bad = {"servo_rms_px": 3.0, "success_rate": 1.0}, {"success_rate": 0.0}
    assert aim.score([good, good]) < aim.score([good, bad]) < aim.score([bad, bad])
    assert aim.is_worse([bad, bad], [good, good, good])
    assert not aim.is_worse([good], [good, good])


@pytest.mark.parametrize(
    ("minimise", "keep", "sentence"),
    [
        (
            "servo_rms",
            (),
            "--minimise: there is no measure 'servo_rms'; did you mean 'servo_rms_px'?",
        ),
        ("step_ms", (), "--minimise: there is no measure 'step_ms'"),
        ("settle_s", ("servo_rms_px<40",), "--keep servo_rms_px<40: this is no condition: write"),
        ("settle_s", ("servo_rms_px<=many",), "--keep servo_rms_px<=many: this is no condition"),
        ("settle_s", ("succes_rate>=1",), "did you mean 'success_rate'?"),
    ],
)
def test_a_wrong_aim_is_a_sentence(minimise, keep, sentence):
    with pytest.raises(Mistake) as error:
        Aim.read(minimise, keep)
    assert sentence in str(error.value)


def test_conditions_are_written_as_they_are_read():
    texts = ["success_rate>=0.95", "effort_rms_mm_s<=40"]
    assert list(map(str, Aim.read("settle_s", texts).keep)) == texts
    (short,) = Aim.read("settle_s", ["servo_rms_px <= .5"]).keep
    (large,) = Aim.read("settle_s", ["servo_rms_px<=1E3"]).keep
    assert (str(short), str(large)) == ("servo_rms_px<=0.5", "servo_rms_px<=1000")


def test_a_small_budget_and_a_missing_package_are_sentences(monkeypatch):
    with pytest.raises(
        Mistake, match="--budget 39: this is too small: with 8 seeds give at least 40"
    ):
        check_budget(39, 8)
    monkeypatch.setattr(search_module, "find_spec", lambda _: None)
    with pytest.raises(Mistake, match=r"pip install 'servobench\[tune\]'"):
        check_budget(300, 8)


def test_settings_are_ranges_or_values():
    assert space.asked(
        ["controller.gain=0.2:5:log", "run.latency=1:4", "estimator.kind=none,imm"]
    ) == [
        Draw("controller.gain", "log_uniform", (0.2, 5.0)),
        Draw("run.latency", "uniform", (1.0, 4.0)),
        Draw("estimator.kind", "choice", ("none", "imm")),
    ]


@pytest.mark.parametrize(
    "text",
    [
        "controller.gain",
        "controller.gain=2",
        "=1:2",
        "controller.gain=5:1",
        "a=0:1:log",
        "run.seed=1:2",
    ],
)
def test_wrong_settings_are_a_sentence(text):
    with pytest.raises(Mistake, match="--settings"):
        space.asked([text])
    with pytest.raises(Mistake, match="given twice"):
        space.asked(["controller.gain=1:2"] * 2)


def test_the_usual_settings_are_gain_noise_and_prediction():
    late = load("line", ["run.latency=3"])
    draws = space.usual(late, flat(late.settings(), ""))
    assert [draw.key for draw in draws] == ["controller.gain", "estimator.ratio", "estimator.kind"]
    most = 60 * np.sin(np.pi / 14)
    assert draws[0].numbers == pytest.approx((most / 50, most))
    assert draws[2].numbers == ("kalman_cv", "error_kalman")
    early = load("line")
    assert len(space.usual(early, flat(early.settings(), ""))) == 2
    still = load("line", ["controller.kind=hold", "estimator.kind=none"])
    with pytest.raises(Mistake, match="no usual settings"):
        space.usual(still, flat(still.settings(), ""))


@pytest.mark.parametrize(
    ("gain", "ends"), [(0.2, (0.1, 60.0)), (40.0, (1.6, 80.0)), (800.0, (32.0, 1000.0))]
)
def test_the_gain_of_the_scenario_and_its_double_are_searched_as_far_as_a_controller_takes_them(
    gain, ends
):
    prompt = load("line", [f"controller.gain={gain}", "run.latency=0", "run.tracker_ms=0"])
    draws = space.usual(prompt, flat(prompt.settings(), ""))
    assert draws[0].numbers == pytest.approx(ends)
    load("line", [f"controller.gain={ends[1]}"])
    with pytest.raises(Mistake, match=r"less than or equal to 1000"):
        load("line", ["controller.gain=1000.1"])


def test_settings_of_a_replaced_kind_are_left_out():
    own = {"estimator.kind": "kalman_cv", "estimator.ratio": None, "tracker.particles": 100}
    proposed = {"estimator.ratio": 0.1, "tracker.particles": 61.7, "estimator.kind": "imm"}
    assert space.finished(proposed, own) == {"estimator.kind": "imm", "tracker.particles": 62}
    proposed["estimator.kind"] = "kalman_cv"
    assert space.finished(proposed, own) == {"estimator.ratio": 0.1, "tracker.particles": 62}


def tuned(folder, **options):
    given = {"scenario": "still", "changes": FREE, "settings": (), "keep": (), "out": folder}
    return tune_command.run(**QUICK | given | options)


def test_the_command_writes_lines_and_a_page_and_repeats_no_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("servo.cli.jobs.FIRST", 0.0)
    assert tuned(tmp_path, quiet=False) == 0
    said = capsys.readouterr()
    assert "tune: 14 runs at most, 0 of them finished\n" in said.out
    assert said.err.startswith("tune: 1 of 14, seed 1, ")
    written = json.loads((tmp_path / "tune.json").read_text())
    assert (tmp_path / "tuned.toml").read_text().startswith("[")
    whole = flat(load(str(tmp_path / "scenario.toml")).settings(), "")
    assert {key: whole[key] for key in written["best"]} == written["best"]
    assert (whole["robot.kind"], whole["run.duration"]) == ("free", 0.5)  # the command's changes
    assert f"servobench run {tmp_path / 'scenario.toml'}\n" in said.out.replace("\n  ", " ")
    assert "What each setting does" in (tmp_path / "report.html").read_text()
    assert len(written["fresh_after"]) == 2
    monkeypatch.setattr("servo.study.execute._run", lambda job, folder: 1 / 0)
    assert tuned(tmp_path, quiet=False) == 0
    assert "tune: 14 runs at most, 14 of them finished\n" in capsys.readouterr().out
    assert json.loads((tmp_path / "tune.json").read_text()) == written
    with pytest.raises(Mistake, match=r"has its page already: open report\.html"):
        report_command.write([tmp_path], None)


def test_the_command_says_where_nothing_keeps_the_conditions(tmp_path, capsys):
    with pytest.raises(
        Mistake, match=r"keep servo_rms_px<=0\.001; the nearest are .*, with servo_rms_px"
    ):
        tuned(tmp_path, keep=("servo_rms_px<=0.001",), quiet=False)
    assert "servobench run" not in capsys.readouterr().out
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ("controller.gian=1:2", "--settings controller.gian = 1.0: .*did you mean"),
        ("controller.gain=-1:2", "greater"),
    ],
)
def test_settings_that_the_scenario_lacks_are_a_sentence(tmp_path, settings, sentence):
    with pytest.raises(Mistake, match=sentence):
        tuned(tmp_path, settings=(settings,))


def test_a_condition_is_broken_by_a_share_of_its_bound():
    runs = [{"effort_rms_mm_s": 45.0}, {"effort_rms_mm_s": 30.0}, {}, {"effort_rms_mm_s": np.inf}]
    at_most, at_least = (Condition.read(f"effort_rms_mm_s{sign}40") for sign in ("<=", ">="))
    assert at_most.excess(runs).tolist() == [0.125, -0.25, 10.0, 10.0]
    assert at_least.excess(runs).tolist() == [-0.125, 0.25, 10.0, 10.0]
    assert Condition.read("effort_rms_mm_s<=0").excess(runs[:1]).tolist() == [45.0]
    assert Condition.read("effort_rms_mm_s>=-20").excess(runs[:1]).tolist() == [-3.25]


def test_a_score_is_what_is_broken_and_missing_and_the_mean_of_the_others():
    aim = Aim.read("servo_rms_px", ["effort_rms_mm_s<=40", "success_rate>=1"])
    one = {"servo_rms_px": 2.0, "effort_rms_mm_s": 60.0, "success_rate": 1.0}
    other = {"servo_rms_px": 5.0, "effort_rms_mm_s": 40.0, "success_rate": 0.0}
    assert aim.score([one, other]) == (0.25 + 0.5, 3.5)
    lost = {"success_rate": 1.0, "effort_rms_mm_s": 0.0}
    assert aim.score([one, lost]) == (10 * 0.5, 2.0)
    assert aim.score([lost, lost]) == (10.0, np.inf)


def test_settings_are_worse_if_a_paired_test_is_sure():
    """Of differences 1, 2 and 3: t = 2 / (1 / sqrt(3)) = 3.46, and 2.92 is the quantile."""

    def runs(*errors):
        return [{"servo_rms_px": error} for error in errors]

    aim = Aim.read("servo_rms_px", ())
    best = runs(1.0, 1.0, 1.0, 9.0)
    assert aim.is_worse(runs(2.0, 3.0, 4.0), best)
    assert aim.is_worse(runs(1.85, 3.0, 4.15), best)  # t = 2 / (1.15 / sqrt(3)) = 3.01
    assert not aim.is_worse(runs(1.8, 3.0, 4.2), best)  # t = 2 / (1.2 / sqrt(3)) = 2.89
    assert not aim.is_worse(runs(1.0, 1.0), best)
    assert not aim.is_worse(runs(0.0, -1.0, -2.0), best)
    bounded = Aim.read("servo_rms_px", ["servo_rms_px<=0.5"])
    assert not bounded.is_worse(runs(2.0, 3.0, 4.0), best)  # the best breaks the condition


def test_a_budget_is_enough_for_five_candidates():
    check_budget(40, 8)
    with pytest.raises(Mistake) as refused:
        check_budget(39, 8)
    assert str(refused.value) == (
        "--budget 39: this is too small: with 8 seeds give at least 40 runs, for the settings as "
        "they are and 4 others"
    )


def test_a_search_uses_its_whole_budget():
    for budget, most in ((10, 10), (11, 10), (14, 14)):
        tried, _ = found(Aim.read("servo_rms_px", ()), budget, seeds=[1, 2])
        assert sum(len(one.runs) for one in tried) == most
        assert len(tried) == most // 2


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({}, "No candidate is better than the scenario as it is."),
        (
            {"controller.gain": 2.0},
            "The best settings are controller.gain = 2: servo_rms_px is lower by 2 as a mean over 2 fresh seeds.",
        ),
    ],
)
def test_the_result_of_a_search_is_a_sentence(settings, sentence):
    runs = [{"servo_rms_px": 3.0, "success_rate": 1.0}] * 2
    better = [{"servo_rms_px": 1.0, "success_rate": 1.0}] * 2
    best = Candidate(settings, better)
    aim = Aim.read("servo_rms_px", [])
    found = Tuned(aim, {"controller.gain": 1.0}, [Candidate({}, runs), best], best, runs, better)
    assert found.sentence == sentence


def test_a_gain_without_a_value_is_said_and_is_not_in_the_table():
    lost, kept = {"success_rate": 0.0}, {"success_rate": 1.0, "settle_s": 0.5}
    best = Candidate({"controller.gain": 2.0}, [kept, kept])
    tried = [Candidate({}, [lost, lost]), best]
    aim = Aim.read("settle_s", [])
    found = Tuned(aim, {"controller.gain": 1.0}, tried, best, [lost, kept], [kept, lost])
    assert found.sentence == (
        "The best settings are controller.gain = 2. By how much they lower settle_s is not known: "
        "none of 2 fresh seeds has a value with them and with the scenario as it is."
    )
    assert found.table().rows[-1] == ["settle_s, less", "s", "", NOTHING]


def test_a_range_of_whole_numbers_and_a_delay_in_place_of_another(tmp_path):
    changes = (*FREE, "run.latency_ms=60.0")
    assert tuned(tmp_path, settings=("run.latency=0:2",), changes=changes) == 0
    whole = load(str(tmp_path / "scenario.toml"))
    best = json.loads((tmp_path / "tune.json").read_text())["best"]
    assert (whole.run.latency, whole.run.latency_ms) == (best["run.latency"], None)
    assert type(best["run.latency"]) is int
