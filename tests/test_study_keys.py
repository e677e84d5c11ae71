"""A study that sets a thing twice, a thing that is no setting, or far too much, is one sentence."""

import re

import pytest

from servo.mistake import Mistake
from servo.scenario.catalogue import shipped
from servo.scenario.named_files import path_of
from servo.study.parse import load

STILL = "scenario = 'still'\n"
ONE_LAW = "expected one distribution with its numbers, one of linspace, geomspace, uniform, log_uniform, normal, choice"
BAD = {
    "an empty law": (
        STILL + "axes.controller.gain = {}",
        f"axes.controller.gain = {{}}: {ONE_LAW}",
    ),
    "a law and more": (
        STILL + "axes.controller.gain = { foo = 1, uniform = [1, 2] }",
        f"axes.controller.gain = {{'foo': 1, 'uniform': [1, 2]}}: {ONE_LAW}",
    ),
    "no choice": (
        STILL + "axes.controller.gain = { choice = [] }",
        "axes.controller.gain.choice = []: expected a list of at least one value",
    ),
    "too large a range": (
        STILL + "axes.start.x = { uniform = [-1e308, 1e308] }",
        "axes.start.x.uniform = [-1e+308, 1e+308]: a number is above 1e+100",
    ),
    "a count of true": (
        STILL + "axes.start.x = { linspace = [0.0, 1.0, true] }",
        "axes.start.x.linspace = [0.0, 1.0, True]: one of these is not a finite number",
    ),
    "an end of a draw out of range": (
        STILL + "axes.start.scale = { uniform = [0.5, 500.0] }",
        "in the run with start.scale = 500.0: still.toml: start.scale = 500.0: input should be less than or "
        "equal to 100",
    ),
    "a late value out of range": (  # behind the 2,000 combinations that are looked at
        STILL + "axes.start.x = { linspace = [0.0, 10_001.0, 3] }\n"
        "axes.start.y = { linspace = [0.0, 1.0, 600] }\naxes.run.latency = [1, 2]",
        "in the run with start.x = 10001.0, start.y = 0.0, run.latency = 1: still.toml: start.x = 10001.0: "
        "input should be less than or equal to 10000",
    ),
    "the same scenario twice": (
        "scenario = ['still', 'still']",
        "scenario: 'still' and 'still' are the same file: leave one of them out",
    ),
    "a scenario and its path": (
        f"scenario = ['still', '{path_of('still')}']",
        f"scenario: '{path_of('still')}' and 'still' are the same file: leave one of them out",
    ),
    "all scenarios and one more": (
        "scenario = ['*', 'still']",
        f"scenario: there is no scenario '*'; there is {', '.join(shipped())} (or give a .toml "
        "file)",
    ),
    "very many scenarios": (
        f"scenario = {['still'] * 10_000}",
        "scenario: 'still' and 'still' are the same file: leave one of them out",
    ),
    "very many values": (
        STILL + f"axes.start.x = {list(range(10_001))}",
        "axes.start.x has 10,001 values; the limit is 10,000",
    ),
    "a number and its equal": (
        STILL + "axes.start.x = [1, 1.0]",
        "axes.start.x has the same value twice: leave one out",
    ),
    "one key in two spellings": (
        STILL + "[axes]\n'run.latency' = [1]\n'run.latency ' = [2]",
        "axes: run.latency is given twice",
    ),
    "one key as an axis and drawn": (
        STILL + "[axes]\n'start.x' = [1]\n' start . x' = { uniform = [1, 2] }",
        "axes: start.x is given twice",
    ),
    "an empty name": (
        STILL + "[axes]\n'run..latency' = [1]",
        "axes: 'run..latency' is not the name of a setting, such as run.latency",
    ),
    "a seed for all": (
        STILL + "set.run.seed = 3",
        "set.run.seed: list these under `seeds` instead, or count them with --seeds",
    ),
    "the table of the seed": (
        STILL + "axes.run = [{ seed = 1 }, { seed = 2 }]",
        "axes.run: name one of its settings, such as run.latency",
    ),
    "bounds as an axis": (
        STILL + "axes.expect.settle_s = [1, 2]",
        "axes.expect.settle_s: bounds change nothing in a run; those of the study are under "
        "`expect`",
    ),
    "a study as an axis": (
        STILL + "axes.sweep.seeds = [1, 2]",
        "axes.sweep.seeds: a study changes the settings of runs only; leave this out",
    ),
    "a setting for all that varies": (
        STILL + "set.run.latency = 1\naxes.run.latency = [1, 2]",
        "set.run.latency: axes.run.latency varies this setting already: leave one of them out",
    ),
    "an axis in another one's table": (
        STILL + "[axes]\ntracker = [{ kind = 'kams' }]\n'tracker.particles' = [9]",
        "axes.tracker.particles: axes.tracker sets all of tracker already: leave one of them out",
    ),
    "a list that the scenario lacks": (
        STILL + "axes.disturbances.0.start = [1]",
        "'disturbances.0.start' leads through '0', which is not a table: correct it",
    ),
    "very many seeds": (
        STILL + "seeds = 9_000_000_000_000_000_000",
        "seeds = 9000000000000000000: input should be less than or equal to 1000000",
    ),
    "more runs than can be written out": (
        STILL + "[axes]\n" + "\n".join(f"goal.x{i} = {list(range(10))}" for i in range(4400)),
        "this study has more runs than the limit, 1,000,000: give fewer values or seeds",
    ),
    "comparing what is drawn": (
        STILL + "compare = 'start.x'\naxes.start.x = { uniform = [1, 2] }",
        "compare = 'start.x': this setting is drawn at random; name an axis of the study",
    ),
    "comparing a list": (
        STILL + "compare = []\naxes.run.latency = [1, 2]",
        "compare = []: input should be a valid string",
    ),
    "a bound that is a list": (
        STILL + "expect.settle_s = [1]",
        "expect.settle_s = [1]: input should be a valid number",
    ),
    "a share above 1": (
        STILL + "expect.success_rate = 7",
        "expect.success_rate should be a share from 0 to 1",
    ),
    "a bound of the scenario that is a list": (
        STILL + "set.expect.settle_s = [1]",
        "in the run with expect.settle_s = [1]: still.toml: expect.settle_s = [1]: input should be a valid number",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_it_is_one_sentence(name, tmp_path):
    text, expected = BAD[name]
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(Mistake) as told:
        load(str(tmp_path / "mine.toml"))
    assert str(told.value) == f"mine.toml: {expected}"


CHANGES = {
    "run.seed=3": "--set run.seed=3: list these under `seeds` instead, or count them with --seeds",
    " run . latency = 3": "--set  run . latency = 3: axes.run.latency varies this setting already: leave one of them out",
    "run={ latency = 3 }": (
        "--set run={ latency = 3 }: axes.run.latency varies this setting already: leave one of them out"
    ),
    "tracker={}": "axes.tracker.kind: --set tracker={} sets all of tracker already: leave one of them out",
    "start.x=wide": (
        "in the run with start.x = wide, run.latency = 1, tracker.kind = frozen: still.toml: start.x = "
        "'wide': input should be a valid number"
    ),
}


@pytest.mark.parametrize(
    ("change", "axis"),
    [("run.latency_ms=200", "run.latency = [1, 2]"), ("run.latency=2", "run.latency_ms = [9.0]")],
)
def test_a_delay_is_given_by_one_of_its_two_settings(change, axis, tmp_path):
    (tmp_path / "mine.toml").write_text(f"{STILL}axes.{axis}\n")
    sentence = f"--set {change}: axes.{axis.split()[0]} varies this setting already: leave one"
    with pytest.raises(Mistake, match=re.escape(sentence)):
        load(str(tmp_path / "mine.toml"), [change])


def test_groups_of_one_axis_may_give_a_delay_in_both_ways(tmp_path):
    (tmp_path / "mine.toml").write_text(
        f"{STILL}[named.delay.short]\nrun.latency = 1\n[named.delay.long]\nrun.latency_ms = 200.0\n"
    )
    assert len(list(load(str(tmp_path / "mine.toml")).jobs())) == 2 * 3


@pytest.mark.parametrize("change", CHANGES)
def test_a_mistake_in_a_change_of_a_study_names_it(change, tmp_path):
    axes = "axes.run.latency = [1, 2]\naxes.tracker.kind = ['frozen']"
    (tmp_path / "mine.toml").write_text(STILL + axes)
    with pytest.raises(Mistake) as told:
        load(str(tmp_path / "mine.toml"), [change])
    assert str(told.value) == f"mine.toml: {CHANGES[change]}"


def test_more_seeds_than_runs_are_refused():
    with pytest.raises(Mistake) as told:
        load("particles", seeds=10**18)
    assert str(told.value) == "--seeds 1000000000000000000: give at most 1,000,000"


def test_a_wrong_scenario_is_blamed_and_not_a_cell(tmp_path):
    (tmp_path / "base.toml").write_text("run.latncy = 2")
    (tmp_path / "mine.toml").write_text("scenario = 'base.toml'\naxes.run.latency = [1, 2]")
    with pytest.raises(Mistake) as told:
        load(str(tmp_path / "mine.toml"))
    assert str(told.value) == (
        "mine.toml: base.toml: run: there is no key 'latncy'; did you mean 'latency'?"
    )


def test_names_that_differ_only_in_their_folder_are_two_scenarios(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "same.toml").write_text(f"run.latency = {len(name)}")
    (tmp_path / "mine.toml").write_text("scenario = ['a/same.toml', 'b/same.toml']\nseeds = 1")
    study = load(str(tmp_path / "mine.toml"))
    assert [run.settings["scenario"] for run in study.jobs()] == [
        str(tmp_path / name / "same.toml") for name in ("a", "b")
    ]
