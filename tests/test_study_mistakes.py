"""What is wrong in a study is one sentence, before anything runs."""

from importlib import resources

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servo.cli import main
from servo.mistake import Mistake
from servo.study.parse import load

STILL = "scenario = 'still'\n"
BAD = {
    "unknown key": (
        "sceanrio = 'still'",
        "there is no key 'sceanrio'; did you mean 'scenario'?",
    ),
    "no scenario": ("", "scenario: a value is missing"),
    "empty axis": (
        STILL + "axes.run.latency = []",
        "axes.run.latency = []: expected a list of values, or one of linspace, geomspace, uniform, "
        "log_uniform, normal, choice",
    ),
    "seeds as an axis": (
        STILL + "axes.run.seed = [1, 2]",
        "axes.run.seed: list these under `seeds` instead, or count them with --seeds",
    ),
    "a value twice": (
        STILL + "axes.run.latency = [1, 1]",
        "axes.run.latency has the same value twice: leave one out",
    ),
    "wrong setting": (
        STILL + "axes.run.latncy = [1]",
        "in the run with run.latncy = 1: still.toml: run: there is no key 'latncy'; did you mean 'latency'?",
    ),
    "wrong value": (
        STILL + "axes.run.latency = [1, 500]",
        "in the run with run.latency = 500: still.toml: run.latency = 500: input should be less than or "
        "equal to 100",
    ),
    "a section as a name": (
        STILL + "named.start.near = { start.x = 1.0 }",
        "named.start: 'start' is reserved for a setting, a section or a result; give the axis another name",
    ),
    "a result as a name": (
        STILL + "named.success.near = { start.x = 1.0 }",
        "named.success: 'success' is reserved for a setting, a section or a result; give the axis another name",
    ),
    "a measure as a name": (
        STILL + "named.settle_s.near = { start.x = 1.0 }",
        "named.settle_s: 'settle_s' is reserved for a setting, a section or a result; give the axis another name",
    ),
    "a setting as a name": (
        STILL + 'named."run.latency".a = { run.duration = 1 }\naxes.run.latency = [1, 2]',
        "named.run.latency: 'run.latency' is reserved for a setting, a section or a result; give the axis another name",
    ),
    "groups that are none": (
        STILL + "named.scheme = { a = 1 }",
        "named.scheme.a = 1: this should be a table",
    ),
    "a group and an axis": (
        STILL + "named.scheme.a = { run.latency = 1 }\naxes.run.latency = [1]",
        "axes.run.latency: named.scheme varies this setting already: leave one of them out",
    ),
    "a wrong setting in a group": (
        STILL + "named.scheme.a = { run.latncy = 1 }",
        "in the run with scheme = a: still.toml: run: there is no key 'latncy'; did you mean 'latency'?",
    ),
    "too few numbers": (
        STILL + "axes.start.x = { uniform = [1.0] }",
        "axes.start.x.uniform = [1.0]: expected a list of 2 numbers",
    ),
    "numbers turned": (
        STILL + "axes.start.x = { uniform = [2.0, 1.0] }",
        "axes.start.x.uniform = [2.0, 1.0]: the first number is larger than the second",
    ),
    "logarithm of zero": (
        STILL + "axes.start.scale = { log_uniform = [0.0, 1.0] }",
        "axes.start.scale.log_uniform = [0.0, 1.0]: a number is not above 0",
    ),
    "not finite": (
        STILL + "axes.start.x = { normal = [0.0, inf] }",
        "axes.start.x.normal = [0.0, inf]: one of these is not a finite number",
    ),
    "a count that is none": (
        STILL + "axes.start.x = { linspace = [0.0, 1.0, 1e9] }",
        "axes.start.x.linspace: the count is 1000000000.0; give a whole number from 1 to 10,000",
    ),
    "too many runs": (
        STILL + "seeds = 1000\naxes.start.x = { linspace = [0.0, 1.0, 5000] }",
        "this study has more runs than the limit, 1,000,000: give fewer values or seeds",
    ),
    "seeds": (
        STILL + "seeds = -1",
        "seeds = -1: input should be greater than or equal to 1",
    ),
    "unknown bound": (
        STILL + "expect.sucess_rate = 1",
        "expect: there is no key 'sucess_rate'; did you mean 'success_rate'?",
    ),
    "unknown axis": (
        STILL + "compare = 'start.x'\naxes.run.latency = [1]",
        "compare: there is no axis 'start.x'; there is run.latency",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_mistake_in_a_study_is_one_sentence(name, tmp_path):
    text, expected = BAD[name]
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(Mistake) as told:
        load(str(tmp_path / "mine.toml"))
    assert str(told.value) == f"mine.toml: {expected}"


def test_an_unknown_study_is_one_sentence():
    with pytest.raises(Mistake) as told:
        load("particle")
    assert str(told.value) == (
        "there is no study 'particle'; did you mean 'particles'? (or give a .toml file)"
    )


def test_a_missing_scheduler_is_one_sentence(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("servo.study.cluster.tasks.PATIENCE", 0.5)
    words = ["servobench", "sweep", "particles", "--scheduler", "tcp://127.0.0.1:1", "-q"]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 2
    said = capfd.readouterr().err
    assert said.startswith(
        "servobench: --scheduler tcp://127.0.0.1:1: no scheduler with workers answers there"
    )
    assert len(said.splitlines()) == 1


NAMES = ("particles", "noise", "latency_gain", "depth_error")
TEXTS = [(resources.files("scenes") / "studies" / f"{n}.toml").read_bytes() for n in NAMES]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "any.toml"


@pytest.mark.wide
@settings(max_examples=60)
@given(st.sampled_from(TEXTS), st.data())
def test_any_file_is_a_study_or_one_sentence(path, text, data):
    begin = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(begin, min(begin + 30, len(text))))
    piece = data.draw(
        st.binary(max_size=10) | st.sampled_from([b"[]", b"{}", b"-1", b"nan", b'"*"'])
    )
    path.write_bytes(text[:begin] + piece + text[end:])
    assert outcome(path)


def outcome(path):
    """The number of runs, or the sentence; anything else is raised."""
    try:
        return load(str(path)).size
    except Mistake as mistake:
        return str(mistake)
