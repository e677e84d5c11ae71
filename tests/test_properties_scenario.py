"""Whatever stands in a scenario: it is one, within all limits, or a sentence says what is wrong."""

import copy
import dataclasses
import math
import tomllib
from importlib import resources
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from annotated_types import Ge, Gt, Le, Lt
from hypothesis import given, settings
from hypothesis import strategies as st

from servo.mistake import LONGEST, Mistake
from servo.scenario import load as s
from servo.scenario.catalogue import LISTS, PLUGINS, shipped
from servo.scenario.toml import DEEPEST, LARGEST_FILE

BASE = tomllib.loads((resources.files("scenes") / "occlusion.toml").read_text(encoding="utf-8"))
KINDS = {key: folder.names() for key, (folder, _) in PLUGINS.items()}
KINDS |= {key: folder.names() for key, folder in LISTS.items()}
SCALARS = st.one_of(
    st.booleans(),
    st.integers(),
    st.integers(-3, 40),
    st.integers(1, 9000).map(lambda n: 10**n),
    st.floats(),
    st.floats(0.1, 2.0),
    st.text(),
    st.dates(),
    st.times(),
    st.datetimes(),
    st.sampled_from(["", "nan", "\n", "\x1b[31m", "\ud800", "mean", "ibvs", "__class__"]),
)
NUMBERS = st.floats(0.0, 1.0) | st.integers(0, 9) | st.floats() | st.integers()
VALUES = st.recursive(
    SCALARS,
    lambda v: st.lists(v, max_size=3) | st.dictionaries(st.text(), v, max_size=2),
    max_leaves=5,
)
MOVES = {
    Ge: lambda v, m: v >= m.ge,
    Gt: lambda v, m: v > m.gt,
    Le: lambda v, m: v <= m.le,
    Lt: lambda v, m: v < m.lt,
}


def settings_of(key):
    """Names of the settings that a table of a scenario may have."""
    if key in s.SECTIONS:
        return [f.name for f in dataclasses.fields(s.SECTIONS[key])]
    folder = {**LISTS, **{k: f for k, (f, _) in PLUGINS.items()}}.get(key)
    configs = [folder.config_of(kind) for kind in KINDS[key]] if folder else []
    return sorted({f.name for c in configs for f in dataclasses.fields(c)} | {"kind", "preset"})


NAMES = {key: settings_of(key) for key in s.KEYS}
PLACES = [f"{key}.{name}" for key, names in NAMES.items() for name in names]


@st.composite
def tables(draw):
    """A scenario that works, with some of its values replaced by anything, or nothing like one."""
    table = copy.deepcopy(BASE)
    for _ in range(draw(st.integers(0, 3))):
        key = draw(st.sampled_from(s.KEYS))
        names = st.sampled_from(NAMES[key])
        known = st.dictionaries(names, NUMBERS, max_size=2)
        section = draw(known | st.dictionaries(names | st.text(), VALUES, max_size=2))
        if key in KINDS and draw(st.booleans()):
            section["kind"] = draw(st.sampled_from(KINDS[key]))
        usual = [section] if key in LISTS else section
        table[key] = draw(st.just(usual) | st.sampled_from([section, [section]]) | VALUES)
    return table


def outcome(call, *args):
    """A scenario, whose values are then checked, or the sentence."""
    try:
        found = call(*args)
    except Mistake as mistake:
        line = str(mistake)
        assert line.isprintable()  # so it is one line, too
        assert 0 < len(line) <= LONGEST + len(" [...] ")
        return line
    for field in dataclasses.fields(found):
        value = getattr(found, field.name)
        for config in value if isinstance(value, tuple) else [value]:
            if dataclasses.is_dataclass(config):
                check_limits(config)
    return found


def check_limits(config):
    for name, hint in get_type_hints(type(config), include_extras=True).items():
        value = getattr(config, name, None)
        if dataclasses.is_dataclass(value):
            check_limits(value)
        for part in (hint, *get_args(hint)):
            limits = part.__metadata__ if get_origin(part) is Annotated else ()
            if isinstance(value, int | float):
                assert math.isfinite(value)
                assert all(MOVES[type(limit)](value, limit) for limit in limits), (name, value)


@settings(max_examples=100)
@given(tables())
def test_any_table_is_a_scenario_within_its_limits_or_one_sentence(table):
    outcome(s.parse, table, "any", "any.toml")


@settings(max_examples=50)
@given(st.dictionaries(st.sampled_from(s.KEYS) | st.text(), VALUES))
def test_a_table_of_nothing_we_know_is_one_sentence(table):
    outcome(s.parse, table, "any", "any.toml")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "any.toml"


TEXTS = [(resources.files("scenes") / f"{name}.toml").read_bytes() for name in shipped()]


@st.composite
def mutated(draw):
    """A scenario's text in which a piece is cut out and another put in its place."""
    text = draw(st.sampled_from(TEXTS))
    begin = draw(st.integers(0, len(text)))
    end = draw(st.integers(begin, min(begin + 30, len(text))))
    piece = draw(st.binary(max_size=20) | st.text(max_size=20).map(lambda t: t.encode()))
    return text[:begin] + piece + text[end:]


@settings(max_examples=150)
@given(st.one_of(mutated(), st.binary(), st.text().map(lambda text: text.encode())))
def test_any_file_is_a_scenario_or_one_sentence(path, content):
    path.write_bytes(content)
    outcome(s.load, str(path))


WORDS = [*s.KEYS, *(n for names in NAMES.values() for n in names), "0", "9" * 99]
PATHS = st.lists(st.sampled_from(WORDS) | st.text(max_size=5), max_size=4).map(".".join)
TEXT_VALUES = st.one_of(
    st.text(),
    SCALARS.filter(lambda v: not isinstance(v, int) or v.bit_length() < 10_000).map(str),
    st.sampled_from(
        ["[" * 2000, "{" * 2000, "0x" + "f" * 9000, "9" * 5000, "1\nrun.seed=2", "nan"]
    ),
)
WILD = st.tuples(PATHS, TEXT_VALUES).map("=".join)
PLAIN = st.tuples(st.sampled_from(PLACES), NUMBERS.map(str)).map("=".join)


@settings(max_examples=150)
@given(st.tuples(PLAIN) | st.lists(st.text() | WILD, min_size=1, max_size=3))
def test_any_override_is_taken_or_refused_in_one_sentence(changes):
    outcome(s.load, "occlusion", changes)


@given(st.text() | st.text().map(lambda text: f"{text}.toml"))
def test_any_name_is_a_scenario_or_one_sentence(name):
    outcome(s.load, name)


TOO_LARGE = (
    "an integer has more than 64 bits; give one from -9223372036854775808 to 9223372036854775807"
)
TOO_DEEP = f"tables and lists are nested too deep; the limit is {DEEPEST} levels"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[run]\nseed = " + "9" * 5000, "this is not TOML: Exceeds the limit"),
        ("[run]\nseed = 0x" + "f" * 9000, TOO_LARGE),
        ("a = " + "[" * 5000, "this is not TOML: maximum recursion depth"),
        (".".join("a" * 5000) + " = 1", TOO_DEEP),
        ('"a\\nb" = 1', "there is no key 'a\\nb'; there is run, world, "),
    ],
    ids=["digits", "hexadecimal", "lists", "tables", "a line break"],
)
def test_what_python_itself_gives_up_on_is_a_sentence_with_its_limit(path, text, message):
    path.write_text(text)
    assert outcome(s.load, str(path)).startswith(f"any.toml: {message}")


def test_a_file_that_is_far_too_long_is_not_read_to_its_end(path):
    path.write_text("# " + "x" * LARGEST_FILE)
    assert outcome(s.load, str(path)) == (
        f"{path}: cannot read this scenario: it is too large; the limit is 1,000,000 bytes"
    )
