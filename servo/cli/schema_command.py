"""The command `servobench schema`: the JSON Schema of scenarios with their bounds and studies."""

from __future__ import annotations

import json

from servo.loop.run_measures import MEANINGS, Outcome
from servo.scenario.schema import Schema, scenario_schema, table
from servo.study import parse
from servo.study.axes import ENDS, LAWS, MOST_VALUES, SPANS


def text() -> str:
    """The schema as JSON."""
    return json.dumps(scenario_schema(expect_schema(), sweep_schema()), indent=1)


def expect_schema() -> Schema:
    """Schema of the table of bounds: any measure, and the outcome."""
    ends = list(Outcome.__members__)
    outcome = {"enum": ends, "description": f"How the run has to end: {', '.join(ends)}."}
    return table({"outcome": outcome} | _bounds(), "Outcome and largest measures of a good run.")


def sweep_schema() -> Schema:
    """Schema of the table of a study of this scenario."""
    share = {"type": "number", "minimum": 0, "maximum": 1, "description": "Share of good runs."}
    seed, most = {"type": "integer", "minimum": 0}, {"maximum": parse.MOST_RUNS}
    name = {"type": "string"}
    properties: Schema = {
        "scenario": {
            "description": 'Scenarios to run; by default this one. "*": all shipped ones.',
            "anyOf": [name, {"type": "array", "items": name, "minItems": 1}],
        },
        "set": {"description": "Settings of all runs, by dotted keys.", "type": "object"},
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


def _axes() -> Schema:
    """Schema of nested tables of settings, each with a list of values, a span, or a draw."""
    number = {"type": "number"}
    counts = dict.fromkeys(SPANS, 3) | LAWS
    laws: list[Schema] = []
    for name, count in counts.items():
        length = {"minItems": 1} if count is None else {"minItems": count, "maxItems": count}
        values = {"type": "array"} | length | ({} if count is None else {"items": number})
        laws.append(table({name: values}) | {"required": [name]})
    some = {"type": "array", "minItems": 1, "maxItems": MOST_VALUES}
    nested = {"$ref": "#/properties/sweep/properties/axes"}
    return {
        "description": 'Values of settings, by dotted keys: a list, a law, or "*" for all kinds.',
        "type": "object",
        "propertyNames": {"not": {"enum": sorted(ENDS)}},
        "additionalProperties": {"anyOf": [some, {"const": parse.ALL}, *laws, nested]},
    }
