"""Studies as values, and the folder that keeps them: what is run, what is drawn, what is shown."""

import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from rich.console import Console

from servo.cli import sweep_command
from servo.loop.episode import Episode
from servo.report import study_data
from servo.scenario import load as scenarios
from servo.scenario.catalogue import shipped
from servo.scenario.draws import Draw
from servo.scenario.named_files import digest_of
from servo.study import results, scenario_run, store
from servo.study.bounds import missed_by_cells
from servo.study.parse import load
from servo.study.run import Failure
from servo.study.scenario_run import MEASURED, TIMES
from servo.study.store import StudyFile
from tracking.trackers import general_kinds

SMALL = """# mine
# Two trackers on a car that stands.
scenario = "still"
seeds = 2

[set]
run.duration = 0.3
measure.after = 0.2

[axes]
tracker.kind = ["frozen", "pf_ssd"]
run.latency = [0, 2]
start.x = { uniform = [-20.0, 20.0] }
"""


@pytest.fixture
def small(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SMALL)
    return load("mine.toml")


def test_axes_make_cells_and_every_cell_has_every_seed(small):
    runs = list(small.jobs())
    assert small.size == len(runs) == 8
    assert small.title == "Two trackers on a car that stands."
    cells = [(r.settings["tracker.kind"], r.settings["run.latency"], r.seed) for r in runs]
    assert cells[:3] == [("frozen", 0, 0), ("frozen", 0, 1), ("frozen", 2, 0)]
    assert len(set(cells)) == 8
    assert [r.number for r in runs] == list(range(8))
    assert [r.pictured for r in runs] == [True, False] * 4
    assert small.compare == "tracker.kind"


def test_what_is_drawn_depends_on_the_seed_alone(small):
    drawn = {}
    for run in small.jobs():
        drawn.setdefault(run.seed, set()).add(run.settings["start.x"])
    assert [len(values) for values in drawn.values()] == [1, 1]
    assert drawn[0] != drawn[1]
    with_another_axis = replace(small, axes=small.axes[:1])
    assert {r.settings["start.x"] for r in with_another_axis.jobs()} == drawn[0] | drawn[1]


@pytest.mark.parametrize(
    ("law", "numbers", "low", "high"),
    [
        ("uniform", (-2.0, 3.0), -2, 3),
        ("log_uniform", (0.1, 10.0), 0.1, 10),
        ("choice", (1.0, 2.0), 1, 2),
    ],
)
def test_draws_lie_within_their_law(law, numbers, low, high):
    values = [Draw("start.x", law, numbers).value(seed) for seed in range(300)]
    assert low <= min(values) < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < max(values) <= high
    if law == "log_uniform":
        assert np.median(values) == pytest.approx(1.0, rel=0.4)


def test_normal_draws_have_their_mean_and_spread():
    values = [Draw("start.x", "normal", (5.0, 2.0)).value(seed) for seed in range(500)]
    assert np.mean(values) == pytest.approx(5.0, abs=0.3)  # three standard errors
    assert np.std(values) == pytest.approx(2.0, rel=0.1)


def test_the_command_of_a_run_makes_its_very_scenario(small):
    for run in small.jobs():
        words = run.command.split()
        sets = [words[i + 1].strip("'") for i, word in enumerate(words) if word == "--set"]
        alone = scenarios.load("still", sets, run.seed)
        assert alone.settings() == run.subject.parsed(run.seed, run.settings).settings()


@pytest.mark.wide
def test_the_study_of_trackers_has_all_that_follow_the_car():
    everything = load("trackers")
    every = {*general_kinds()} - {"homography"}
    of_car = {n for n in shipped() if "*" in scenarios.load(n).bounds.others}
    found = {(r.settings["tracker.kind"], r.subject.name) for r in everything.jobs()}
    assert found == {*itertools.product(every, of_car)}
    assert everything.size == len(every) * len(of_car) * 3


def test_a_scenario_may_carry_its_study_and_runs_without_it(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(
        '# own\n# Mine.\n[motion]\nkind = "still"\n[sweep]\nseeds = [3, 5]\n'
        "axes.run.latency = [1, 2, 3]\n"
    )
    study = load(str(path))
    latency = scenarios.load(str(path)).run.latency
    assert (study.size, study.seeds, latency) == (6, (3, 5), 1)
    assert {r.subject.parsed(r.seed, r.settings).run.latency for r in study.jobs()} == {1, 2, 3}


@pytest.fixture
def kept(small, tmp_path):
    """The store of the small study with four runs in it."""
    with store.opened(tmp_path / "out", StudyFile.of(small, "me")) as there:
        for run in list(small.jobs())[:4]:
            there.add(run, run.run(tmp_path))
        yield there


def test_a_row_has_every_axis_draw_measure_and_version(kept, small):
    table = kept.table()
    assert table.num_rows == 4
    row = table.to_pylist()[3]
    assert (row["run"], row["seed"], row["tracker.kind"], row["run.latency"]) == (3, 1, "frozen", 2)
    assert row["start.x"] == next(r.settings["start.x"] for r in small.jobs() if r.seed == 1)
    assert row["version_mujoco"].split(".")[0].isdecimal()
    assert row["servo_rms_px"] > 0
    assert row["outcome"] == "TIMED_OUT"
    assert not row["success"]


def test_other_programs_find_rows_and_series_in_parquet(kept):
    results, series = kept.export(kept.table())
    assert pq.read_table(results).equals(kept.table())
    first, second, *_ = pq.read_table(series).to_pylist()
    assert [first["run"], second["run"]] == [0, 1]
    assert len(first["time_s"]) == len(first["servo_error_px"]) == 9
    assert first["sheet"][:2] == b"\xff\xd8"  # a JPEG
    assert second["sheet"] is None


def test_a_run_alone_is_the_run_in_the_study(kept, small):
    again = list(small.jobs())[3].run(kept.folder).row
    row = kept.records(small.jobs())[3].row
    for name, value in row.items():
        if name not in TIMES:
            assert again[name] == value, name


def test_a_failure_keeps_traceback_and_command_also_when_the_run_succeeds(kept, small):
    run = list(small.jobs())[5]
    kept.fail(run, Failure("Traceback: it broke"))
    path = kept.failure_path(run)
    told = json.loads(path.read_text())
    assert told["error"] == "Traceback: it broke"
    assert told["command"].startswith("servobench run still --seed 1 --set tracker.kind=pf_ssd")
    kept.add(run, run.run(kept.folder))
    assert path.exists()


def rows(*held):
    """Rows of the small study: (tracker, latency, seed, success, rms)."""
    blank = dict.fromkeys(MEASURED)
    names = ("tracker.kind", "run.latency", "seed", "success", "servo_rms_px")
    return [blank | dict(zip(names, one, strict=True)) for one in held]


def test_cells_have_means_with_intervals_and_pairs_are_compared(small):
    found = rows(
        *(("frozen", 0, s, False, 9.0) for s in range(10)),
        *(("pf_ssd", 0, s, s > 0, 1.0 + s) for s in range(10)),
    )
    cells = results.cells_of(small, found)
    assert [c.settings for c in cells] == [
        {"tracker.kind": "frozen", "run.latency": 0},
        {"tracker.kind": "pf_ssd", "run.latency": 0},
    ]
    low = pytest.approx(0.5958, abs=1e-4)  # Wilson, 9 of 10
    success = cells[1].success
    assert (cells[1].unit, success.value, success.units, success.low) == ("draw", 0.9, 10, low)
    assert cells[1].means["servo_rms_px"].value == 5.5
    assert "settle_s" not in cells[1].means
    (pair,) = results.comparisons(small.compare, ["tracker.kind", "run.latency"], found, drawn=True)
    assert (pair.first, pair.second) == ("pf_ssd", "frozen")
    assert (pair.test.wins, pair.test.losses, pair.test.ties) == (9, 0, 1)
    assert pair.p_holm == pytest.approx(2 / 2**9)


def test_a_list_is_a_value_of_an_axis_in_reports_too(tmp_path):
    (tmp_path / "mine.toml").write_text(
        'scenario = "still"\nseeds = 1\nset = { run.duration = 0.1, tracker.kind = "frozen" }\n'
        '[axes]\n"believed.hand_eye_mm" = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]]\n'
    )
    study = load(str(tmp_path / "mine.toml"))
    with store.opened(tmp_path / "out", StudyFile.of(study, "me")) as kept:
        for run in study.jobs():
            kept.add(run, run.run(kept.folder))
    groups = study_data.load(tmp_path / "out").groups("believed.hand_eye_mm")
    assert {name: len(rows) for name, rows in groups.items()} == {
        "[0.0, 0.0, 0.0]": 1,
        "[20.0, 0.0, 0.0]": 1,
    }


def test_a_bound_is_for_every_cell():
    found = rows(*(("frozen", k, s, s > k, 1.0 + k) for k in (0, 2) for s in range(4)))
    bounds = {"success_rate": 0.7, "servo_rms_px": 2.0}
    assert missed_by_cells(results.grouped(["tracker.kind", "run.latency"], found), bounds) == [
        "tracker.kind = frozen, run.latency = 2: success_rate is 0.25, expected at least 0.7",
        "tracker.kind = frozen, run.latency = 2: servo_rms_px is 3, expected at most 2",
    ]


def test_one_run_without_a_value_misses_the_bound_of_its_cell():
    """As nine of ten runs that never settle: the tenth does not speak for them."""
    found = [
        row | {"settle_s": None} for row in rows(*(("frozen", 0, s, True, 1.0) for s in range(9)))
    ]
    found.append(found[0] | {"seed": 9, "settle_s": 2.0})
    assert missed_by_cells(results.grouped([], found), {"settle_s": 3.0, "servo_rms_px": 3.0}) == [
        "all runs: settle_s has no finite value in 9 of 10 runs, expected at most 3"
    ]
    settled = [row | {"settle_s": 2.0} for row in found]
    assert missed_by_cells(results.grouped([], settled), {"settle_s": 3.0}) == []


def test_in_a_narrow_terminal_names_give_way_and_no_digit_is_left_out(small, capsys):
    (cell,) = results.cells_of(small, rows(*(("frozen", 0, s, True, 1.237) for s in range(10))))
    long = {"estimator.kind": "kalman_cv", "believed.depth_factor": 0.354, "scenario": "reversal"}
    cells = [replace(cell, settings=long)]
    sweep_command._print_cells(Console(width=64), cells, ["servo_rms_px", "servo_peak_px"])
    assert re.search(r"10 draws +1 \(0\.722 to 1\) +1\.24", capsys.readouterr().out)


def test_the_runs_of_a_study_share_what_is_built_once(small, monkeypatch, tmp_path):
    """Robot and target, of which a mesh takes 65 ms; other files of the study begin anew."""
    given = []

    class Kept(Episode):
        def __init__(self, *words, kept, **options):
            given.append(kept)
            super().__init__(*words, kept=kept, **options)

    monkeypatch.setattr(scenario_run, "Episode", Kept)
    first, second = list(small.jobs())[:2]
    (tmp_path / "file").write_text("x")
    path = str(tmp_path / "file")
    files = replace(second.subject, files={path: digest_of(path)})
    for job in (first, second, replace(second, subject=files)):
        job.run(tmp_path)
    assert given[0]
    assert given[0] is given[1]
    assert given[2] is not given[0]
