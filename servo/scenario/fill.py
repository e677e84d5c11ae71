"""TOML tables into frozen dataclasses, strictly: a wrong key, type or range is one sentence."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
from typing import Any

from pydantic import ConfigDict, ValidationError, create_model

from servo.mistake import Mistake, unknown
from sim import kinds
from sim.installed import Trusted
from sim.kinds import Kinds

STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
FORMS = ("bool", "float", "int", "str")
MESSAGES = {
    "unexpected_keyword_argument": "there is no such key",
    "missing": "a value is missing",
    "tuple_type": "this should be a list",
    "dataclass_type": "this should be a table of settings",
}
"""Our words where pydantic's speak of Python."""


def fill(config: type[Any], table: Any, place: str) -> Any:
    """An instance of a dataclass from a table.

    Raises:
        Mistake: A key is unknown, or a value has the wrong type or is out of range.
    """
    if not isinstance(table, dict):
        raise Mistake(f"{place} should be a table of settings, not {table!r}")
    fields = list(config.__dataclass_fields__)
    for key in table:
        if key not in fields:
            raise Mistake(f"{place}: {unknown(key, fields)}")
    try:
        # By way of JSON, in which lists may become tuples and strings enums though types are
        # strict.
        text = json.dumps({"it": _completed(config, table)}, default=str)
        return _section(config).model_validate_json(text).it
    except ValidationError as error:
        raise Mistake(_sentence(_nearest(error.errors()), place)) from None


def _completed(config: type[Any], table: dict[str, Any]) -> dict[str, Any]:
    """A table whose inner tables have the values that this dataclass begins with, where they leave
    some out: those may differ from the defaults of the inner dataclass itself.
    """
    complete = dict(table)
    for field in dataclasses.fields(config):
        given = table.get(field.name)
        if isinstance(given, dict) and field.default_factory is not dataclasses.MISSING:
            begin = field.default_factory()
            if dataclasses.is_dataclass(begin) and not isinstance(begin, type):
                complete[field.name] = dataclasses.asdict(begin) | given
    return complete


def _nearest(errors: list[Any]) -> Any:
    """The first error; of a value that may have several forms, the one that went furthest."""
    first = errors[0]["loc"]
    begin = tuple(itertools.takewhile(_is_place, first))
    rivals = errors if begin != first else errors[:1]
    return max((e for e in rivals if e["loc"][: len(begin)] == begin), key=lambda e: len(e["loc"]))


def _is_place(part: Any) -> bool:
    """Whether part of an error's place is a key or an index, not the name of one of several forms
    such as "str" or "tuple[int,int]".
    """
    return isinstance(part, int) or (part.isidentifier() and part not in FORMS)


def _sentence(error: Any, place: str) -> str:
    """What pydantic found, with the place of the value."""
    where = "".join(f".{part}" for part in error["loc"][1:] if _is_place(part))
    if error["type"] == "value_error":  # a `Config` refused several values together
        return f"{place}{where}: {error['ctx']['error']}"
    said = MESSAGES.get(error["type"]) or error["msg"][0].lower() + error["msg"][1:]
    found = "" if error["type"] == "missing" else f" = {error['input']!r}"
    return f"{place}{where}{found}: {said}"


@functools.cache  # building one takes longer than a hundred uses
def _section(config: type[Any]) -> Any:
    return create_model("Section", __config__=STRICT, it=(config, ...))


def fill_plugin(folder: Kinds[Any], table: Any, place: str, default: str | None = None) -> Any:
    """The `Config` of the kind that a table names, filled from the rest of the table.

    A `preset` gives the settings that the table leaves open.

    Raises:
        Mistake: As for `fill`, or the kind or preset is unknown.
    """
    if not isinstance(table, dict):
        raise Mistake(f"{place} should be a table with a kind, not {table!r}")
    kind = table.get("kind", default)
    if kind is None:
        raise Mistake(f"{place} needs a kind: one of {', '.join(folder.names())}")
    kind = kind if isinstance(kind, str) else str(kind)
    try:
        config = folder.config_of(kind)
    except kinds.UnknownKind as error:
        raise Mistake(f"{place}.kind: {error}") from error
    try:
        name = table.get("preset")
        begin = {} if name is None else folder.preset(kind, str(name))
    except kinds.UnknownKind as error:
        raise Mistake(f"{place}.preset: {error}") from None
    given = {k: v for k, v in table.items() if k not in ("kind", "preset")}
    for key in getattr(config, "not_from_file", ()):
        if key in given and not isinstance(given[key], Trusted):
            raise Mistake(
                f"{place}.{key}: a file may not name a command to start: give it with --set, or "
                "from Python"
            )
    tables = {
        k: dataclasses.asdict(v) if dataclasses.is_dataclass(v) and not isinstance(v, type) else v
        for k, v in begin.items()
    }
    return fill(config, tables | given, place)


def fill_plugins(folder: Kinds[Any], tables: Any, place: str) -> tuple[Any, ...]:
    """One `Config` for each table of a list.

    Raises:
        Mistake: As for `fill_plugin`.
    """
    if not isinstance(tables, list):
        raise Mistake(f"{place} should be a list of tables, not {tables!r}")
    return tuple(fill_plugin(folder, t, f"{place}[{i}]") for i, t in enumerate(tables))
