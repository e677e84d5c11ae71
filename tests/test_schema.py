"""The JSON Schema of a scenario: it takes what the parser takes, and refuses what that refuses."""

import copy
import json
import tomllib

import pytest
from jsonschema import Draft202012Validator

from servo.cli import schema_command
from servo.mistake import Mistake
from servo.scenario.catalogue import LISTS, PLUGINS, shipped
from servo.scenario.load import parse
from servo.scenario.tables import SECTIONS

DIRECTIVE = "#:schema scenario.schema.json"


@pytest.fixture(scope="module")
def schema():
    return json.loads(schema_command.text())


@pytest.fixture(scope="module")
def refused(schema):
    validator = Draft202012Validator(schema)
    return lambda table: not validator.is_valid(table)


def refused_by_parser(table):
    try:
        parse(copy.deepcopy(table), "mine", "mine.toml")
    except Mistake:
        return True
    return False


def tables():
    """Each section, and each kind of a part: its place in a scenario, as a function of settings."""
    found = {name: lambda s, name=name: {name: s} for name in SECTIONS}
    for part, (folder, _) in PLUGINS.items():
        for kind in folder.names():
            found[f"{part}.{kind}"] = lambda s, part=part, kind=kind: {part: {"kind": kind} | s}
    for part, folder in LISTS.items():
        for kind in folder.names():
            found[f"{part}.{kind}"] = lambda s, part=part, kind=kind: {part: [{"kind": kind} | s]}
    return found


TABLES = tables()


def followed(schema, item):
    """An item, or the definition that it refers to."""
    name = item.get("$ref", "").rpartition("/")[2]
    return schema["$defs"][name] if name else item


def settings_of(schema, name):
    """The schema of a section's or a kind's settings."""
    part, _, kind = name.partition(".")
    section = followed(schema, schema["properties"][part])
    if kind:
        branches = [followed(schema, b) for b in section.get("items", section)["oneOf"]]
        (section,) = [b for b in branches if b["properties"]["kind"]["const"] == kind]
    return {k: item for k, item in section["properties"].items() if k not in ("kind", "preset")}


def leaves(schema, settings):
    """Settings and how to put a value there, those of nested tables too."""
    for key, about in settings.items():
        item = followed(schema, about) | about
        if item.get("type") == "object":
            for place, inner in leaves(schema, item["properties"]):
                yield (lambda v, key=key, place=place: {key: place(v)}), inner
        else:
            yield (lambda v, key=key: {key: v}), item


@pytest.mark.newest
def test_it_is_a_schema_and_the_file_is_what_the_command_prints(root, schema, capfd):
    Draft202012Validator.check_schema(schema)
    kept = (root / "scenes" / "scenario.schema.json").read_text(encoding="utf-8")
    assert kept == schema_command.text() + "\n", (
        "make it anew: servobench schema > scenes/scenario.schema.json"
    )


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_scenario_is_valid_and_carries_the_schema(root, schema, name):
    text = (root / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
    head = text[: text.index("[")].splitlines()  # editors read comments before the first table only
    assert [line for line in head if line.startswith("#:")] == [DIRECTIVE]
    assert all(line.startswith("#") for line in head)
    Draft202012Validator(schema).validate(tomllib.loads(text))


@pytest.mark.parametrize("name", TABLES)
def test_every_setting_has_a_meaning_and_a_default_that_fits(schema, name):
    at = TABLES[name]
    for put, item in leaves(schema, settings_of(schema, name)):
        assert item["description"]
        if "default" in item:
            Draft202012Validator(schema).validate(at(put(item["default"])))


@pytest.mark.parametrize("name", TABLES)
def test_schema_and_parser_refuse_the_same_values(schema, refused, name):
    """The whole schema refuses one wrong value of each setting; the others, the setting's own part
    of it refuses, in a hundredth of the time.
    """
    at = TABLES[name]
    assert not refused(at({})) | refused_by_parser(at({}))
    for put, item in leaves(schema, settings_of(schema, name)):
        own = Draft202012Validator(item | {"$defs": schema["$defs"]})
        choices = item.get("anyOf", [item])
        any_text = any(
            one.get("type") == "string" and not {"enum", "const"} & one.keys() for one in choices
        )
        other = 1 if any_text or item.get("type") == "array" else "no such value"
        wrong = [{}, [[]], other, True]
        if item.get("type") == "boolean":
            wrong[-1] = 1
        for limit, beyond in (("minimum", -1), ("maximum", 1)):
            if limit in item:
                wrong.append(item[limit] + beyond)
                assert own.is_valid(item[limit]), (name, item)
        for limit in ("exclusiveMinimum", "exclusiveMaximum"):
            wrong += [item[limit]] if limit in item else []
        assert refused(at(put(wrong[-1]))), (name, item)
        for value in wrong:
            assert not own.is_valid(value), (name, item, value)
            assert refused_by_parser(at(put(value))), (name, item, value)


@pytest.mark.parametrize(
    "table",
    [
        {"no_such_table": {}},
        {"camera": {"no_such_key": 1}},
        {"tracker": {"kind": "kams", "no_such_key": 1}},
        {"tracker": {"kind": "kams", "lock": {"no_such_key": 1}}},
        {"tracker": {"kind": "magic"}},
        {"tracker": {"kind": "kams", "preset": "magic"}},
        {"tracker": {"kind": "frozen", "preset": "paper"}},
        {"motion": {"kind": "still", "speed": 0.1}},  # of another kind
        {"motion": {"speed": 0.1}},  # a line's; the default kind is another
        {"disturbances": [{"start": 1.0}]},
        {"disturbances": {"kind": "board"}},
        {"camera": []},
        {"expect": 1.0},
        {"sweep": []},
    ],
)
def test_a_wrong_table_is_refused_by_both(refused, table):
    assert refused(table)
    assert refused_by_parser(table)


@pytest.mark.parametrize(
    "expect",
    [
        {"servo_rms": 1.0},
        {"servo_rms_px": "low"},
        {"outcome": "WON"},
        {"outcome": 1.0},
    ],
)
def test_bounds_on_what_is_not_measured_are_refused(refused, expect):
    assert refused({"expect": expect})
    assert not refused({"expect": {"servo_rms_px": 1, "outcome": "CONVERGED"}})


@pytest.mark.parametrize(
    "sweep",
    [
        {"axis": {}},
        {"axes": {"run": {"latency": []}}},
        {"axes": {"run": {"latency": 3}}},
        {"axes": {"start": {"x": {"uniform": [1.0]}}}},
        {"axes": {"start": {"x": {"uniform": []}}}},
        {"axes": {"start": {"x": {"uniform": ["a", "b"]}}}},
        {"axes": {"uniform": [1]}},
        {"seeds": -1},
        {"seeds": []},
        {"seeds": [1, 1]},
        {"seeds": 1.5},
        {"compare": 3},
        {"expect": {"success_rate": 2}},
        {"expect": {"outcome": "CONVERGED"}},
        {"scenario": []},
    ],
)
def test_a_wrong_study_is_refused(refused, sweep):
    assert refused({"sweep": sweep})


def test_the_shipped_studies_are_valid_as_studies_of_a_scenario(root, schema):
    for path in sorted((root / "scenes" / "studies").glob("*.toml")):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        Draft202012Validator(schema).validate({"sweep": table})


def test_what_the_first_lines_say_is_found_beside_a_directive():
    from servo.scenario.catalogue import sentence

    for text in ("# run\n# It turns.\n#:schema s.json\n", "#:schema s.json\n# run\n# It turns.\n"):
        assert sentence(text) == "It turns."
    assert sentence("# run\n#:schema s.json\n") == ""
