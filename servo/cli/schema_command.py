"""The command `servobench schema`: the JSON Schema (draft 2020-12) of scenarios and studies.

An editor checks and completes a scenario with it. What several settings must fulfil together is
checked by the parser only.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from enum import Enum
from typing import Any, get_type_hints

from pydantic import TypeAdapter

from servo.loop.run_measures import MEANINGS, Outcome
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import LAWS
from servo.scenario.load import SECTIONS
from servo.study import parse
from servo.study.axes import COUNTS, ENDS, MOST_VALUES
from sim import kinds
from sim.kinds import Kinds


def text() -> str:
    """The schema as JSON."""
    more = {"vary": vary_schema(), "expect": expect_schema(), "sweep": sweep_schema()}
    return json.dumps(scenario_schema(more), indent=1)


def expect_schema() -> Schema:
    """Schema of the table of bounds: any measure, and the outcome."""
    ends = list(Outcome.__members__)
    outcome = {"enum": ends, "description": f"How the run has to end: {', '.join(ends)}."}
    bounds = {"outcome": outcome} | _bounds()
    others = {
        "description": 'The same of another tracker, by its kind; "*": all without a table.',
        "type": "object",
        "additionalProperties": table(bounds),
    }
    about = "Outcome and largest measures of a good run with the scenario's own tracker."
    return table(bounds | {"tracker": others}, about)


def vary_schema() -> Schema:
    """Schema of the table of settings that are drawn for each seed."""
    nested = {"$ref": "#/properties/vary"}
    return {
        "description": "Settings that are drawn for each seed but 0, by dotted keys.",
        "type": "object",
        "additionalProperties": {"anyOf": [*_laws(LAWS), nested]},
    }


def sweep_schema() -> Schema:
    """Schema of the table of a study of this scenario."""
    share = {"type": "number", "minimum": 0, "maximum": 1, "description": "Share of good runs."}
    seed = {"type": "integer", "minimum": 0}
    most = {"maximum": parse.MOST_RUNS}
    name = {"type": "string"}
    properties: Schema = {
        "scenario": {
            "description": 'Scenarios to run; by default this one. "*": all shipped ones.',
            "anyOf": [name, {"type": "array", "items": name, "minItems": 1}],
        },
        "set": {"description": "Settings of all runs, by dotted keys.", "type": "object"},
        "named": {
            "description": "Axes of groups of settings, by the axis's name and the group's.",
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "minProperties": 1,
                "additionalProperties": {"type": "object"},
            },
        },
        "axes": _axes(),
        "seeds": {
            "description": "How many, from 0 on, or a list.",
            "anyOf": [
                seed | most,
                {"type": "array", "items": seed, "minItems": 1, "uniqueItems": True},
            ],
            "default": parse.SEEDS,
        },
        "compare": name | {"description": "The axis whose values are compared with each other."},
        "expect": table({parse.SUCCESS: share} | _bounds(), "Bounds on the whole study."),
    }
    return table(properties, "A study of this scenario: servobench sweep FILE.")


def _bounds() -> Schema:
    return {
        name: {"type": "number", "description": f"{meaning} [{unit}]"}
        for name, (unit, meaning) in MEANINGS.items()
    }


def _laws(counts: Mapping[str, int | None]) -> list[Schema]:
    """Schemas of tables with one law, by how many numbers each takes."""
    number = {"type": "number"}
    laws: list[Schema] = []
    for name, count in counts.items():
        length = {"minItems": 1} if count is None else {"minItems": count, "maxItems": count}
        values = {"type": "array"} | length | ({} if count is None else {"items": number})
        laws.append(table({name: values}) | {"required": [name]})
    return laws


def _axes() -> Schema:
    """Schema of nested tables of settings, each with a list of values, a span, or a draw."""
    laws = _laws(COUNTS)
    some = {"type": "array", "minItems": 1, "maxItems": MOST_VALUES}
    nested = {"$ref": "#/properties/sweep/properties/axes"}
    return {
        "description": 'Values of settings, by dotted keys: a list, a law, or "*" for all kinds.',
        "type": "object",
        "propertyNames": {"not": {"enum": sorted(ENDS)}},
        "additionalProperties": {"anyOf": [some, {"const": parse.ALL}, *laws, nested]},
    }


DRAFT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


def scenario_schema(more: Schema) -> Schema:
    """The schema of a scenario file, given those of the tables that are no settings."""
    properties = {name: _settings(config()) for name, config in SECTIONS.items()}
    for name, (folder, default) in PLUGINS.items():
        properties[name] = _plugin(folder, default)
    for name, folder in LISTS.items():
        properties[name] = {"type": "array", "items": _plugin(folder, None)}
    properties |= more
    return {"$schema": DRAFT, "title": "A scenario of servobench"} | table(properties)


def table(properties: Schema, description: str = "") -> Schema:
    """The schema of a table that has these keys only."""
    about = {"description": description} if description else {}
    return about | {"type": "object", "properties": properties, "additionalProperties": False}


def _plugin(folder: Kinds[Any], default: str | None) -> Schema:
    """A table with a kind: a branch for each kind; the key may be left out for the default one."""
    names = [name for name in folder.names() if _is_whole(folder, name)]
    kind = {"enum": names} if default is None else {"enum": names, "default": default}
    branches = [_branch(folder, name, is_default=name == default) for name in names]
    return {"type": "object", "properties": {"kind": kind}, "oneOf": branches}


def _is_whole(folder: Kinds[Any], kind: str) -> bool:
    """Whether a kind can be imported; those of a broken package are left out."""
    try:
        folder.config_of(kind)
    except kinds.UnknownKind:
        return False
    return True


def _branch(folder: Kinds[Any], kind: str, *, is_default: bool) -> Schema:
    presets = list(folder.presets(kind))
    choices: Schema = {"kind": {"const": kind}}
    if presets:
        choices["preset"] = {"description": "Values of settings not given.", "enum": presets}
    config = folder.config_of(kind)
    settings = _settings(config())["properties"]
    for key in getattr(config, "not_from_file", ()):
        del settings[key]
    found = table(choices | settings, folder.summary(kind))
    return found if is_default else found | {"required": ["kind"]}


def _settings(config: Any) -> Schema:
    """The table of a dataclass, whose instance has the defaults."""
    docs = kinds.field_docs(type(config))
    hints = get_type_hints(type(config), include_extras=True)
    properties: Schema = {}
    for f in dataclasses.fields(config):
        value = getattr(config, f.name)
        if dataclasses.is_dataclass(value):
            found = _settings(value)
        else:
            found = _of_type(hints[f.name])
            if value is not None:
                found["default"] = _plain(value)
        properties[f.name] = found | {"description": docs[f.name]}
    return table(properties, " ".join((type(config).__doc__ or "").split()))


def _of_type(hint: Any) -> Schema:
    """The JSON Schema of a type, without null, which TOML does not have."""
    found = TypeAdapter(hint).json_schema()
    found = _inlined(found, found.pop("$defs", {}))
    found.pop("title", None)
    some = [choice for choice in found.get("anyOf", []) if choice != {"type": "null"}]
    return some[0] if len(some) == 1 else found


def _inlined(schema: Any, definitions: Schema) -> Any:
    """A schema with the definitions in the places that refer to them."""
    if isinstance(schema, list):
        return [_inlined(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return _inlined(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    return {key: _inlined(item, definitions) for key, item in schema.items()}


def _plain(value: Any) -> Any:
    """A default as TOML has it."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value
