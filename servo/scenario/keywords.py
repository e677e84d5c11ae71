"""Changes of a scenario's settings that are given as keywords of Python functions, such as
gain=1.5, or as texts of the option --set.
"""

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from servo.mistake import Mistake, unknown
from servo.scenario.catalogue import PLUGINS
from servo.scenario.toml import is_table, names_of, plain
from sim import kinds


class Change(NamedTuple):
    """A change of a setting of a scenario: the setting's dotted key, its new value, and the option
    or keyword that made the change, for messages.
    """

    key: str
    """The setting, such as "controller.gain"."""
    value: object
    place: str
    """The option or keyword that gives the value, for messages."""


def place_of(changes: Sequence[Change], file: str, *settings: str) -> str:
    """Return where some settings got their values, for a message: the option or keyword of the last
    change of one of them, of a table around it, or of a value inside it.

    Args:
        changes: All changes, in the order in which they are made.
        file: The scenario's file, which is returned if no change concerns the settings.
        *settings: Settings, such as "run.duration" and "disturbances[0].start".
    """
    for change in reversed(changes):
        changed = ".".join([*names_of(change.key), ""])
        for setting in settings:
            path = re.sub(r"\[(\d+)\]", r".\1", setting) + "."
            if path.startswith(changed) or changed.startswith(path):
                return change.place
    return file


def of_keywords(
    given: Mapping[str, object], tables: Sequence[str], known: Sequence[str] = ()
) -> Iterator[Change]:
    """Yield the changes of settings that keywords of a Python function make.

    A keyword is a table (camera={"noise": 3}), a kind (tracker="kams"), a setting with its table
    (**{"start.x": 5}), or a setting whose name is unique (gain=1.5).

    Args:
        given: Values by keyword.
        tables: The names of a scenario's tables.
        known: The full names of all settings, such as "start.x", among which names without a table
            are looked up.

    Raises:
        Mistake: A name without a table is that of no setting, or of several.
    """
    for name, raw in given.items():
        value = plain(raw)
        place = f"{name}={value!r}"
        if name in PLUGINS and isinstance(value, str):
            yield Change(f"{name}.kind", value, place)
        elif name in tables and is_table(value) and value:
            yield from (Change(f"{name}.{key}", v, place) for key, v in value.items())
        elif name in tables or "." in name:
            yield Change(name, value, place)
        else:
            yield Change(_whole(name, known, tables), value, place)


def _whole(name: str, known: Sequence[str], tables: Sequence[str]) -> str:
    """Return the full name of a setting, such as "controller.gain" for "gain".

    Raises:
        Mistake: No setting in `known` has this name, or several have.
    """
    found = [key for key in known if key.rpartition(".")[2] == name]
    if not found:
        names = dict.fromkeys([*tables, *(key.rpartition(".")[2] for key in known)])
        sentence = unknown(name, names, "setting")
        if "did you mean" not in sentence:
            sentence = (
                f"there is no setting '{name}'; `servobench list KIND` (such as kams) or "
                "`servobench list SECTION` (such as camera) prints the settings"
            )
        raise Mistake(sentence)
    if len(found) > 1:
        table, _, key = found[0].rpartition(".")
        choices = ", ".join(found)
        raise Mistake(
            f"{name} is the name of several settings, {choices}: give one of them with its table, "
            f"as {table}={{'{key}': ...}}"
        )
    return found[0]


def own_parts(given: Mapping[str, object]) -> dict[str, Any]:
    """Return, by keyword, the settings (`Config`) of each component that is given as an object of
    Python, such as tracker=MyTracker; keywords with a text or a dictionary, and those that name no
    component, are left out.

    Raises:
        Mistake: An object is neither a `Config` nor can be wrapped as one.
    """
    return {
        key: _own_part(key, value)
        for key, value in given.items()
        if key in PLUGINS and not isinstance(value, str | dict)
    }


def _own_part(key: str, value: object) -> object:
    """Return the `Config` of a component for a scenario's table `key`, wrapped if necessary.

    Raises:
        Mistake: The component is neither a `Config` nor can be wrapped as one.
    """
    is_config = dataclasses.is_dataclass(value) and callable(getattr(value, "build", None))
    if is_config and not isinstance(value, type):
        return value
    name = getattr(value, "__qualname__", repr(value))
    try:
        return PLUGINS[key][0].as_config(value, name)()
    except kinds.UnknownKind as error:
        raise Mistake(f"{key}: {error}") from None
