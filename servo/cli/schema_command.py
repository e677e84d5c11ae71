"""The command `servobench schema`: print the JSON Schema (draft 2020-12) of scenarios and studies.

Editors check and complete scenarios with the schema. Conditions on several settings together are
checked by the parser only.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal, Union

import click
from pydantic import BaseModel, Field, create_model
from pydantic.json_schema import GenerateJsonSchema, SkipJsonSchema
from pydantic_core import core_schema

from servo.loop.measure import MEASURES
from servo.loop.run_measures import Outcome
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import LAWS
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.fill import STRICT, form
from servo.scenario.tables import SECTIONS
from servo.study import parse
from servo.study.plan import COUNTS, ENDS, MOST_VALUES
from sim.kinds import Kinds, UnknownKind, not_from_file

Schema = dict[str, Any]
SHARE: Schema = {"type": "number", "minimum": 0, "maximum": 1}


def run() -> None:
    """Print the JSON Schema of scenarios and studies."""
    click.echo(text())


def text() -> str:
    """Return the JSON Schema of scenarios and studies as JSON."""
    return json.dumps(
        scenario_schema(
            {"vary": vary_schema(), "expect": expect_schema(), "sweep": sweep_schema()}
        ),
        indent=1,
    )


def expect_schema() -> Schema:
    """Return the JSON Schema of the table `expect` of a scenario: the expected outcome of a run and
    upper bounds on its measures, for the scenario's own tracker, for others and for drawn seeds.
    """
    ends = list(Outcome.__members__)
    one = {
        "outcome": {"enum": ends, "description": f"How the run has to end: {', '.join(ends)}."}
    } | _bounds()
    share = SHARE | {"description": "Least share of drawn seeds that end as expected."}
    drawn = "Bounds that replace these where a seed has drawn settings."
    bounds = one | {"drawn": table({SUCCESS_RATE: share} | one, drawn)}
    others = {
        "description": 'The same for other trackers, by kind; "*": all without a table.',
        "type": "object",
        "additionalProperties": table(bounds),
    }
    return table(
        bounds | {"tracker": others},
        "Outcome and largest measures of a good run with the scenario's own tracker.",
    )


def vary_schema() -> Schema:
    """Return the JSON Schema of the table `vary` of a scenario: settings that are drawn for each
    seed, by laws such as `uniform`.
    """
    nested = {"$ref": "#/properties/vary"}
    return {
        "description": "Settings that are drawn for each seed but 0, by dotted keys, such as "
        f"start.x = {{ uniform = [-8, 8] }}. Laws: {', '.join(LAWS)}.",
        "type": "object",
        "additionalProperties": {"anyOf": [*_laws(LAWS), nested]},
    }


def sweep_schema() -> Schema:
    """Return the JSON Schema of the table `sweep` of a scenario, which makes a study of it: axes,
    settings of all runs, seeds, the compared axis and bounds.
    """
    share = SHARE | {"description": "Least share of runs that end as expected."}
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
            "description": "Axes of named groups of settings: AXIS.GROUP = { settings }.",
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "minProperties": 1,
                "additionalProperties": {"type": "object"},
            },
        },
        "axes": _axes(),
        "seeds": {
            "description": "Number of seeds (0, 1, 2, ...), or a list of seeds.",
            "anyOf": [
                seed | most,
                {"type": "array", "items": seed, "minItems": 1, "uniqueItems": True},
            ],
            "default": parse.SEEDS,
        },
        "compare": name | {"description": "The axis whose values are compared with each other."},
        "expect": table({SUCCESS_RATE: share} | _bounds(), "Bounds on the whole study."),
    }
    return table(properties, "A study of this scenario: servobench sweep FILE.")


def _bounds() -> Schema:
    return {
        name: {"type": "number", "description": str(measure)} for name, measure in MEASURES.items()
    }


def _laws(counts: Mapping[str, int | None]) -> list[Schema]:
    """Return, for each law of random draws such as `uniform`, the JSON Schema of a table {law =
    [values]}; `counts` has the number of its values, None for any number.
    """
    number = {"type": "number"}
    laws: list[Schema] = []
    for name, count in counts.items():
        length = {"minItems": 1} if count is None else {"minItems": count, "maxItems": count}
        values = {"type": "array"} | length | ({} if count is None else {"items": number})
        laws.append(table({name: values}) | {"required": [name]})
    return laws


def _axes() -> Schema:
    """Return the JSON Schema of the axes of a study: tables, also nested, whose settings have a
    list of values, a law (a span or a random draw), or "*" for all kinds.
    """
    laws = _laws(COUNTS)
    some = {"type": "array", "minItems": 1, "maxItems": MOST_VALUES}
    nested = {"$ref": "#/properties/sweep/properties/axes"}
    return {
        "description": 'Values of settings, by dotted keys: a list, a law, or "*" for all kinds.',
        "type": "object",
        "propertyNames": {"not": {"enum": sorted(ENDS)}},
        "additionalProperties": {"anyOf": [some, {"const": parse.ALL}, *laws, nested]},
    }


class _Json(GenerateJsonSchema):
    """Generator of schemas for TOML: without null, and without titles that repeat the key."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def nullable_schema(self, schema: core_schema.NullableSchema) -> Schema:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> Schema:
        found = super().default_schema(schema)
        return {key: value for key, value in found.items() if (key, value) != ("default", None)}


def scenario_schema(more: Schema) -> Schema:
    """Return the JSON Schema of a scenario's file.

    Args:
        more: Schemas of the tables `vary`, `expect` and `sweep`, by these names.
    """
    tables: Schema = {
        **{name: form(config, described=True) for name, config in SECTIONS.items()},
        **{name: _table_of_kind(name, *of) for name, of in PLUGINS.items()},
        **{name: list[_table_of_kind(name, kinds)] for name, kinds in LISTS.items()},
    }
    members: Schema = {name: (table, None) for name, table in tables.items()}
    scenario = create_model("Scenario", __config__=STRICT, **members)
    found = scenario.model_json_schema(schema_generator=_Json)
    about = {"$schema": GenerateJsonSchema.schema_dialect, "title": "A scenario of servobench"}
    return found | about | {"properties": found["properties"] | more}


def table(properties: Schema, description: str = "") -> Schema:
    """Return the JSON Schema of a TOML table that may have these keys and no others.

    Args:
        properties: The schema of each key.
        description: Description of the table; "": none.
    """
    about = {"description": description} if description else {}
    return about | {"type": "object", "properties": properties, "additionalProperties": False}


def _table_of_kind(name: str, kinds: Kinds[Any], default: str = "") -> Any:
    """Return the pydantic type of a table with the key `kind`: a union with one model for each kind
    that can be imported. A table of the kind `default` may leave out the key; "": none may.
    """
    models = list[type[BaseModel]]()
    for kind in kinds.names():
        with suppress(UnknownKind):  # of a broken package
            models.append(_model(name, kinds, kind, default))
    return Annotated[Union[*models], Field(discriminator="kind")]


def _model(name: str, kinds: Kinds[Any], kind: str, default: str) -> type[BaseModel]:
    """Return the pydantic model of a table of one kind: its settings, `kind`, and `preset` if the
    kind has presets.
    """
    config = kinds.config_of(kind)
    members: Schema = {"kind": (Literal[kind], default if kind == default else ...)}
    if presets := kinds.presets(kind):
        about = Field(
            None, description="Name of a set of values for the settings that are not given."
        )
        members["preset"] = (Literal[*presets], about)
    members |= dict.fromkeys(not_from_file(config), (SkipJsonSchema[Any], None))
    base = form(config, described=True)
    about = kinds.summary(kind)
    return create_model(f"{name} {kind}", __base__=base, __doc__=about, **members)
