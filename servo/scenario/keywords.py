"""Settings given from Python as keywords, such as gain=1.5, beside texts such as "start.x=-40"."""

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from servo.mistake import Mistake, unknown
from servo.scenario.arguments import texts
from servo.scenario.catalogue import PLUGINS
from servo.scenario.toml import assignment, names_of, plain
from sim import kinds


class Change(NamedTuple):
    """A setting that is changed."""

    key: str
    """Such as "controller.gain"."""
    value: Any
    place: str
    """Where it was given, for messages."""


def place_of(changes: Sequence[Change], file: str, *settings: str) -> str:
    """Return the place that gave settings their values.

    Args:
        changes: In their order.
        file: The place of settings without a change.
        *settings: Such as "run.duration" and "disturbances[0].start".

    Returns:
        The place of the last change of one of them, of a table around it or of a value in it.
    """
    for change in reversed(changes):
        changed = ".".join([*names_of(change.key), ""])
        for setting in settings:
            path = re.sub(r"\[(\d+)\]", r".\1", setting) + "."
            if path.startswith(changed) or changed.startswith(path):
                return change.place
    return file


def of_texts(items: Sequence[str]) -> list[Change]:
    """Return the changes of --set.

    Raises:
        Mistake: An item does not have the form key=value.
    """
    return [Change(*assignment(item), f"--set {item}") for item in texts(items)]


def of_keywords(
    given: Mapping[str, Any], tables: Sequence[str], known: Sequence[str] = ()
) -> Iterator[Change]:
    """Return the changes of keywords: a table (camera={"noise": 3}), a kind (tracker="kams"), a
    setting by its whole name (**{"start.x": 5}), or by its own where no other has that (gain=1.5).

    Args:
        given: The keywords.
        tables: The tables of a scenario.
        known: All settings of the scenario, such as "start.x".

    Raises:
        Mistake: There is no such setting, or there are several.
    """
    for name, raw in given.items():
        value = plain(raw)
        place = f"{name}={value!r}"
        if name in PLUGINS and isinstance(value, str):
            yield Change(f"{name}.kind", value, place)
        elif name in tables and isinstance(value, dict) and value:
            of_kind = sorted(value.items(), key=lambda item: item[0] != "kind")
            yield from (Change(f"{name}.{key}", v, place) for key, v in of_kind)
        elif name in tables or "." in name:
            yield Change(name, value, place)
        else:
            yield Change(_whole(name, known, tables), value, place)


def _whole(name: str, known: Sequence[str], tables: Sequence[str]) -> str:
    """Return the setting of this name, with its table."""
    found = [key for key in known if key.rpartition(".")[2] == name]
    if not found:
        names = dict.fromkeys([*tables, *(key.rpartition(".")[2] for key in known)])
        sentence = unknown(name, names, "setting")
        raise Mistake(sentence if "did you mean" in sentence else f"there is no setting '{name}'")
    if len(found) > 1:
        table, _, key = found[0].rpartition(".")
        choices = ", ".join(found)
        raise Mistake(f"{name}: this is {choices}; say which, as in {table}={{'{key}': ...}}")
    return found[0]


def own_parts(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the `Config` of each keyword that is a part, not a name or a table.

    Raises:
        Mistake: A part is neither a `Config` nor anything that its folder can adapt.
    """
    return {
        key: _own_part(key, value)
        for key, value in given.items()
        if key in PLUGINS and not isinstance(value, str | dict)
    }


def _own_part(key: str, value: Any) -> Any:
    is_config = dataclasses.is_dataclass(value) and callable(getattr(value, "build", None))
    if is_config and not isinstance(value, type):
        return value
    name = getattr(value, "__qualname__", repr(value))
    try:
        return PLUGINS[key][0].as_config(value, name)()
    except kinds.UnknownKind as error:
        raise Mistake(f"{key}: {error}") from None
