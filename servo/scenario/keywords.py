"""Settings given from Python as keywords, such as gain=1.5, beside texts such as "start.x=-40"."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from servo.mistake import Mistake, unknown
from servo.scenario.catalogue import PLUGINS
from servo.scenario.draws import flat
from servo.scenario.given import texts
from servo.scenario.toml import assignment, trusted
from sim import kinds


class Change(NamedTuple):
    """A setting that is changed."""

    key: str
    """Such as "controller.gain"."""
    value: Any
    place: str
    """Where it was given, for messages."""


def of_texts(items: Sequence[str]) -> list[Change]:
    """The changes of --set.

    Raises:
        Mistake: One has not the form key=value.
    """
    return [Change(*assignment(item), f"--set {item}") for item in texts(items)]


def of_keywords(given: Mapping[str, Any], settings: Mapping[str, Any]) -> list[Change]:
    """The changes of keywords: a table (camera={"noise": 3}), a kind (tracker="kams"), a setting by
    its whole name (**{"start.x": 5}), or by its own where no other has that (gain=1.5).

    Args:
        given: The keywords.
        settings: All settings of the scenario, by table.

    Raises:
        Mistake: There is no such setting, or there are several.
    """
    return list(_changes(given, [*flat(settings, "settings")], (*settings, "vary", "expect")))


def _changes(
    given: Mapping[str, Any], known: Sequence[str], tables: Sequence[str]
) -> Iterator[Change]:
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
    """The setting of this name, with its table."""
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


def plain(value: Any) -> Any:
    """A value of Python or NumPy in the types of TOML, its texts trusted."""
    match value:
        case dict():
            return {key: plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case _ if hasattr(value, "tolist"):
            return plain(value.tolist())
        case _ if hasattr(value, "__fspath__"):
            return trusted(str(value))
        case _:
            return trusted(value)


def own_part(key: str, value: Any) -> Any:
    """The `Config` of a part of one's own: an instance, a class, or what `tracking.wrap` takes."""
    name = getattr(value, "__qualname__", repr(value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return value
    try:
        return PLUGINS[key][0].as_config(value, name)()
    except kinds.UnknownKind as error:
        raise Mistake(f"{key}: {error}") from None
