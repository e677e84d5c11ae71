"""Whatever stands in a study: it is one whose runs are all different, or one sentence."""

import itertools
import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servo.mistake import LONGEST, Mistake
from servo.scenario.draws import LAWS
from servo.study import parse
from servo.study.plan import SPANS

NUMBERS = st.one_of(
    st.integers(-3, 12), st.floats(-2.0, 40.0), st.floats(), st.integers(-(1 << 63), (1 << 63) - 1),
    st.sampled_from([5e-324, 1e308, -1e308, 0, -0.0, 10**9]),
)  # fmt: skip
SCALARS = st.one_of(
    NUMBERS,
    st.booleans(),
    st.text(max_size=8),
    st.dates(),
    st.times(),
    st.datetimes(),
    st.sampled_from(["*", "kams", "frozen", "still", "run.latency", "", "é"]),
)
VALUES = st.recursive(
    SCALARS,
    lambda v: st.lists(v, max_size=3) | st.dictionaries(st.text(max_size=5), v, max_size=2),
    max_leaves=5,
)
LAW = st.dictionaries(
    st.sampled_from([*SPANS, *LAWS, "foo"]),
    st.lists(NUMBERS | SCALARS, max_size=3) | VALUES,
    min_size=1,
    max_size=2,
)
KEYS = st.sampled_from(
    [
        "run.latency",
        " run.latency ",
        "run",
        "run.seed",
        "start.x",
        "start.scale",
        "tracker",
        "tracker.kind",
        "tracker.particles",
        "controller.gain",
        "controller.dof",
        "expect",
        "expect.settle_s",
        "sweep",
        "scenario",
        "disturbances.0.start",
        "disturbances.00.start",
        "believed.depth_factor",
        "world.visibility",
        "a..b",
        "",
        "no.such.key",
    ]
)
USUAL = st.lists(st.integers(0, 5) | st.sampled_from(["kams", "frozen"]), min_size=1, max_size=3)
AXES = st.dictionaries(KEYS, USUAL | LAW | VALUES, max_size=3)
SCENARIOS = st.sampled_from(["still", "*", ["still"], ["still", "line"], ["still", "still"]])
TABLES = {
    "scenario": SCENARIOS | VALUES,
    "set": st.dictionaries(KEYS, SCALARS, max_size=2) | VALUES,
    "axes": AXES | VALUES,
    "seeds": st.integers(1, 5) | VALUES | st.lists(st.integers(0, 5)),
    "compare": KEYS | VALUES,
    "expect": st.dictionaries(
        st.sampled_from(["success_rate", "servo_rms_px", "settle_s", "rms"]), NUMBERS | VALUES
    )
    | VALUES,
}
STUDIES = st.fixed_dictionaries(
    {"scenario": SCENARIOS}, optional={k: v for k, v in TABLES.items() if k != "scenario"}
)
"""Mostly studies, and mostly with one thing wrong."""


def toml(value):
    """A value in TOML's words: the inverse of reading it."""
    match value:
        case bool():
            return str(value).lower()
        case float():
            return "nan" if math.isnan(value) else repr(value)
        case str():
            return '"' + "".join(f"\\U{ord(c):08x}" for c in value) + '"'
        case list():
            return f"[{', '.join(map(toml, value))}]"
        case dict():
            return "{" + ", ".join(f"{toml(k)} = {toml(v)}" for k, v in value.items()) + "}"
        case int():
            return str(value)
        case _:
            return value.isoformat()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "any.toml"


def outcome(path, changes=()):
    """A study, all of whose runs are different, or the sentence."""
    try:
        study = parse.load(str(path), changes)
    except Mistake as mistake:
        line = str(mistake)
        assert line.isprintable()
        assert 0 < len(line) <= LONGEST + len(" [...] ")
        return line
    runs = list(itertools.islice(study.jobs(), 50))
    tables = [repr(run.subject.table_of(run.seed, run.settings)) for run in runs]
    assert len({table + run.subject.name for table, run in zip(tables, runs, strict=True)}) == len(
        runs
    )
    for run in runs:
        assert run.subject.parsed(run.seed, run.settings).run.seed == run.seed
        for key, value in run.settings.items():
            if key != "scenario" and not isinstance(value, float | int):
                assert isinstance(value, str | list | dict)
    return study


def write(path, table):
    path.write_text("\n".join(f"{toml(k)} = {toml(v)}" for k, v in table.items()), "utf-8")
    assert list(tomllib.loads(path.read_text("utf-8"))) == list(table)


@pytest.mark.wide
@settings(max_examples=150)
@given(STUDIES | st.fixed_dictionaries({}, optional=TABLES) | st.dictionaries(st.text(), VALUES))
def test_any_table_is_a_study_or_one_sentence(path, table):
    write(path, table)
    outcome(path)


@settings(max_examples=60)
@given(AXES, st.lists(st.tuples(KEYS, SCALARS.map(str)).map("=".join) | st.text(), max_size=2))
def test_any_change_of_a_study_is_taken_or_refused_in_one_sentence(path, axes, changes):
    write(path, {"scenario": "still", "axes": axes, "seeds": 2})
    outcome(path, changes)


@settings(max_examples=60)
@given(LAW)
def test_any_law_draws_values_or_is_refused_in_one_sentence(path, law):
    write(path, {"scenario": "still", "axes": {"start.x": law}, "seeds": 3})
    outcome(path)
