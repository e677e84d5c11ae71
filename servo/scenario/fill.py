"""Conversion of TOML tables to frozen dataclasses of settings; each error is one sentence."""

import functools
import itertools
from dataclasses import fields, is_dataclass, replace
from datetime import date, time
from enum import Enum
from typing import Annotated, Any, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError, create_model
from pydantic_core import ErrorDetails

from servo.mistake import Mistake, unknown
from servo.scenario.toml import is_table
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
"""Sentences that replace pydantic's, which name types of Python."""


class WrongSetting(Mistake):
    """Error about a setting in a table. Its message names the setting but not the file; the caller
    adds the file or option. `setting` is the name, such as "disturbances[0].start".
    """

    def __init__(self, sentence: str, setting: str = "") -> None:
        super().__init__(sentence)
        self.setting = setting
        """The setting, such as "disturbances[0].start"."""


@functools.cache  # building one takes longer than a hundred uses
def form(config: type[Any], *, described: bool) -> type[BaseModel]:
    """Return the pydantic model that checks TOML tables for a dataclass of settings. It is cached.

    Args:
        config: The dataclass; its instance without arguments has the defaults.
        described: Whether the model has the docstring of each setting, for a JSON Schema; finding
            the docstrings takes longer than loading a scenario.

    Raises:
        UnknownKind: The annotation of a setting cannot be evaluated or is no type that pydantic
            knows, or the class cannot be called without arguments.
    """
    try:
        return _form_of(config(), described)
    except Exception as error:  # the annotations of other people's code are evaluated
        why = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
        name = f"{config.__module__}:{config.__qualname__}"
        raise UnknownKind(
            f"the settings of the class {name} cannot be used; correct the class: {why}"
        ) from error


def _form_of(settings: Any, described: bool) -> type[BaseModel]:
    """Return the pydantic model of a dataclass, given its instance with the defaults."""
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
    """Return an instance of a dataclass of settings with the values of a table.

    Args:
        config: The dataclass.
        table: The settings, as read from TOML.
        place: Name of the table, such as "run"; it begins messages.
        begin: Instance that gives the settings which the table leaves out; None: the defaults.

    Raises:
        WrongSetting: A key is unknown, a value has the wrong type or is out of range, or the
            dataclass refuses several values together.
        UnknownKind: An annotation in the dataclass cannot be used.
    """
    begin = config() if begin is None else begin
    if table == {}:
        return begin
    model = form(config, described=False)
    return _changed(begin, validated(model, _values(table), f"{place}."), place)


def validated(model: type[Model], table: object, prefix: str) -> Model:
    """Check a table with a pydantic model, and return the model's instance with the table's values.

    Args:
        model: The model, with the keys of the table, their types and ranges.
        table: The table, as read from TOML.
        prefix: Text before each key in messages, such as "run." or "mine.toml: ".

    Raises:
        WrongSetting: `table` is not a table, a key is unknown or missing, or a value has the wrong
            type or is out of range.
    """
    place = prefix.rstrip(".: ")
    if not is_table(table):
        raise WrongSetting(f"{place} should be a table of settings, not {_shown(table)!r}", place)
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise _wrong(_nearest(error.errors()), prefix, model) from None


def _values(value: object) -> object:
    """Convert a value of TOML to the types of settings: lists to tuples, dates to texts."""
    match value:
        case dict():
            return {key: _values(item) for key, item in value.items()}
        case list():
            return tuple(map(_values, value))
        case str() | date() | time():  # no setting has dates
            return str(value)
        case _:
            return value


def _shown(value: object) -> object:
    """Return a value with lists in place of tuples, as TOML writes them."""
    return [_shown(item) for item in value] if isinstance(value, tuple) else value


def _changed(begin: Any, given: BaseModel, place: str) -> Any:
    """Return a copy of a dataclass with the settings that are set in a pydantic model, also in
    dataclasses inside it.

    Raises:
        WrongSetting: The dataclass refuses a combination of values; `place` begins the message.
    """
    changes: dict[str, object] = {}
    for name in given.model_fields_set:
        value = getattr(given, name)
        if isinstance(value, BaseModel):
            value = _changed(getattr(begin, name), value, f"{place}.{name}")
        changes[name] = value
    try:
        return replace(begin, **changes)
    except ValueError as error:  # a `Config` refused several values together
        raise WrongSetting(f"{place}: {error}", place) from None


OF_NUMBERS = ("float_type", "float_parsing")
"""Errors of a setting that may be any number, not only a whole one."""


def _nearest(errors: list[ErrorDetails]) -> ErrorDetails:
    """Return the error that helps the user most: one about an unknown key, else the first. For a
    setting that may have several types, it is the error of the type that matched the largest part
    of the value; of whole and other numbers, that of the others.
    """
    errors = sorted(errors, key=lambda error: error["type"] != "extra_forbidden")
    first = errors[0]["loc"]
    begin = tuple(itertools.takewhile(_is_place, first))
    rivals = errors if begin != first else errors[:1]
    alike = (error for error in rivals if error["loc"][: len(begin)] == begin)
    return max(alike, key=lambda error: (len(error["loc"]), error["type"] in OF_NUMBERS))


def _is_place(part: int | str) -> bool:
    """Return True if a part of the location in an error of pydantic is a key or an index of the
    user's table, and False if it is an allowed type such as "str" or "tuple[int, int]".
    """
    return isinstance(part, int) or (part.isidentifier() and part not in FORMS)


def _wrong(error: ErrorDetails, prefix: str, model: type[BaseModel]) -> WrongSetting:
    """Return an error of pydantic as a sentence that begins with the name of the setting; `prefix`
    stands before the name.
    """
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
    """Return the settings, a `Config`, of the kind of component that a table names, with the
    table's values.

    Args:
        kinds: All kinds of this component.
        table: The table, as read from TOML; its `kind` names the kind, and its `preset`, if it has
            one, a preset that gives the settings which it leaves out.
        place: Name of the table, such as "tracker"; it begins messages.
        default: The kind of a table without `kind`; "": `kind` is required.
        own: A `Config` that was given from Python; it is used if the table names its kind, and
            gives the settings that the table leaves out.

    Raises:
        WrongSetting: The kind, the preset or a key is unknown, a value has the wrong type or is out
            of range, the `Config` refuses several values together, or a file names a command to
            start.
    """
    if not is_table(table):
        raise WrongSetting(f"{place} should be a table with a kind, not {table!r}", place)
    given = dict(table)
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
        form(config, described=False)
    except UnknownKind as error:
        raise WrongSetting(f"{place}.kind: {error}", f"{place}.kind") from error
    try:
        chosen = None if preset is None else str(preset)
        begin = kinds.config(kind, chosen) if own is None else own
    except UnknownKind as error:
        raise WrongSetting(f"{place}.preset: {error}", f"{place}.preset") from None
    for key in not_from_file(config):
        if key in given and not isinstance(given[key], Trusted):
            raise WrongSetting(
                f"{place}.{key}: a TOML file may not name a command to start; give it with --set "
                "or from Python",
                f"{place}.{key}",
            )
    return fill(config, given, place, begin)
