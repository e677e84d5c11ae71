"""Conversion of tables to frozen dataclasses of settings; each error is one sentence."""

import functools
import itertools
from dataclasses import fields, is_dataclass, replace
from datetime import date, time
from enum import Enum
from typing import Annotated, Any, TypeVar, cast, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError, create_model
from pydantic_core import ErrorDetails

from servo.mistake import Mistake, unknown
from servo.scenario.toml import Table
from sim.installed import Trusted
from sim.kinds import Kinds, UnknownKind, checked, field_docs, kind_of, not_from_file

Config = TypeVar("Config")
Model = TypeVar("Model", bound=BaseModel)
STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
FORMS = ("bool", "float", "int", "str")
MESSAGES = {
    "extra_forbidden": "there is no such key",
    "missing": "a value is missing",
    "tuple_type": "this should be a list",
    "model_type": "this should be a table of settings",
    "dict_type": "this should be a table",
}
"""Sentences in place of those of pydantic that name types of Python."""


class WrongSetting(Mistake):
    """A mistake in a table of settings; the sentence names the setting, but not its file."""

    def __init__(self, sentence: str, setting: str = "") -> None:
        super().__init__(sentence)
        self.setting = setting
        """Such as "disturbances[0].start"."""


@functools.cache  # building one takes longer than a hundred uses
def form(config: type[Any], *, described: bool = False) -> type[BaseModel]:
    """Return the pydantic model that checks tables of a dataclass of settings.

    Args:
        config: The dataclass; its instance without arguments has the defaults.
        described: Describe each setting by the docstring under it, for the JSON Schema; finding
            the docstrings takes longer than loading a scenario.

    Raises:
        UnknownKind: The type of a setting cannot be used, such as one that is not imported.
    """
    try:
        return _form_of(config(), described)
    except Exception as error:  # the annotations of other people's code are evaluated
        why = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
        name = f"{config.__module__}:{config.__qualname__}"
        raise UnknownKind(f"the settings of {name} cannot be used: {why}") from error


def _form_of(settings: Any, described: bool) -> type[BaseModel]:
    config = type(settings)
    hints = get_type_hints(config, include_extras=True)
    docs = field_docs(config) if described else {}
    members: dict[str, Any] = {}
    for field in fields(config):
        default = getattr(settings, field.name)
        hint = hints[field.name]
        if is_dataclass(default):
            hint = _form_of(default, described)
            default = hint()
        elif isinstance(hint, type) and issubclass(hint, Enum):
            hint = Annotated[hint, Strict(False)]  # a table has the value of its member
        members[field.name] = (hint, Field(default, description=docs.get(field.name)))
    return create_model(config.__qualname__, __config__=STRICT, __doc__=config.__doc__, **members)


def fill(config: type[Config], table: object, place: str, begin: Config | None = None) -> Config:
    """Return an instance of a dataclass with the settings of a table.

    Args:
        config: The dataclass.
        table: As TOML has it.
        place: The table's place, with which messages begin.
        begin: The settings that the table leaves open; None: the defaults.

    Raises:
        WrongSetting: A key is unknown, or a value has the wrong type or is out of range.
    """
    begin = config() if begin is None else begin
    if table == {}:
        return begin
    return _changed(begin, validated(form(config), _values(table), f"{place}."), place)


def validated(model: type[Model], table: object, prefix: str) -> Model:
    """Return a table as an instance of a pydantic model.

    Args:
        model: Names the keys of the table, and their types and ranges.
        table: As TOML has it.
        prefix: Stands before each key in messages: "run." or "mine.toml: ".

    Raises:
        WrongSetting: A key is unknown, or a value has the wrong type or is out of range.
    """
    place = prefix.rstrip(".: ")
    if not isinstance(table, dict):
        raise WrongSetting(f"{place} should be a table of settings, not {_shown(table)!r}", place)
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise _wrong(_nearest(error.errors()), prefix, model) from None


def _values(value: Any) -> Any:
    """Return a value of TOML in the types that settings have: tuples for lists, plain texts."""
    match value:
        case dict():
            return {key: _values(item) for key, item in value.items()}
        case list():
            return tuple(map(_values, value))
        case str() | date() | time():  # no setting has dates
            return str(value)
        case _:
            return value


def _shown(value: Any) -> Any:
    """Return a value as it stands in a table, for messages."""
    return [_shown(item) for item in value] if isinstance(value, tuple) else value


def _changed(begin: Any, given: BaseModel, place: str) -> Any:
    """Return settings with the changes of a table and of the tables inside it."""
    changes: dict[str, Any] = {}
    for name in given.model_fields_set:
        value = getattr(given, name)
        if isinstance(value, BaseModel):
            value = _changed(getattr(begin, name), value, f"{place}.{name}")
        changes[name] = value
    try:
        return replace(begin, **changes)
    except ValueError as error:  # a `Config` refused several values together
        raise WrongSetting(f"{place}: {error}", place) from None


def _nearest(errors: list[ErrorDetails]) -> ErrorDetails:
    """Return the first error, unknown keys before others; of a value with several forms, the one
    that went furthest.
    """
    errors = sorted(errors, key=lambda error: error["type"] != "extra_forbidden")
    first = errors[0]["loc"]
    begin = tuple(itertools.takewhile(_is_place, first))
    rivals = errors if begin != first else errors[:1]
    return max((e for e in rivals if e["loc"][: len(begin)] == begin), key=lambda e: len(e["loc"]))


def _is_place(part: int | str) -> bool:
    """Return whether part of an error's place is a key or an index, not the name of one of several
    forms such as "str" or "tuple[int, int]".
    """
    return isinstance(part, int) or (part.isidentifier() and part not in FORMS)


def _wrong(error: ErrorDetails, prefix: str, model: type[BaseModel]) -> WrongSetting:
    """Return an error of pydantic as a sentence, with the place of the value."""
    key, *inside = error["loc"]
    if error["type"] == "extra_forbidden" and not inside:
        sentence = unknown(str(key), model.model_fields)
        return WrongSetting(f"{prefix.rstrip('.: ')}: {sentence}", f"{prefix}{key}")
    where = prefix + ".".join(str(part) for part in error["loc"] if _is_place(part))
    sentence = MESSAGES.get(error["type"]) or error["msg"][0].lower() + error["msg"][1:]
    found = "" if error["type"] == "missing" else f" = {_shown(error['input'])!r}"
    return WrongSetting(f"{where}{found}: {sentence}", where)


def fill_plugin(
    kinds: Kinds[Config], table: object, place: str, default: str = "", own: Config | None = None
) -> Config:
    """Return the `Config` of the kind that a table names, with the other settings of the table.

    Args:
        kinds: All kinds of this part.
        table: As TOML has it; a `preset` in it gives the settings that it leaves open.
        place: The table's place, with which messages begin.
        default: The kind of a table that names none.
        own: A part that was given from Python; its kind is not imported again.

    Raises:
        WrongSetting: As for `fill`, or the kind or preset is unknown.
    """
    if not isinstance(table, dict):
        raise WrongSetting(f"{place} should be a table with a kind, not {table!r}", place)
    given = dict(cast(Table, table))
    kind = given.pop("kind", default)
    if own is not None and kind != kind_of(own):
        own = None
    if own is not None and not given:
        try:
            return checked(own, place)
        except ValueError as error:
            raise WrongSetting(str(error), place) from None
    preset = given.pop("preset", None) if own is None else None
    if kind == "" and "kind" not in table:
        raise WrongSetting(f"{place} needs a kind: one of {', '.join(kinds.names())}", place)
    kind = kind if isinstance(kind, str) else str(kind)
    try:
        config = kinds.config_of(kind) if own is None else type(own)
        form(config)
    except UnknownKind as error:
        raise WrongSetting(f"{place}.kind: {error}", f"{place}.kind") from error
    try:
        chosen = preset if preset is None else str(preset)
        begin = kinds.config(kind, chosen) if own is None else own
    except UnknownKind as error:
        raise WrongSetting(f"{place}.preset: {error}", f"{place}.preset") from None
    for key in not_from_file(config):
        if key in given and not isinstance(given[key], Trusted):
            raise WrongSetting(
                f"{place}.{key}: a file may not name a command to start: give it with --set, or "
                "from Python",
                f"{place}.{key}",
            )
    return fill(config, given, place, begin)
