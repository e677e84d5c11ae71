"""The command that repeats a run, found from its settings and tried before it is shown."""

from __future__ import annotations

import json
import shlex
from typing import Any

from servo.mistake import Mistake
from servo.scenario import load as scenarios
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.load import Scenario

Settings = dict[str, Any]


def command(name: str, seed: int, settings: Settings, expect: dict[str, float | str]) -> str | None:
    """`servobench run ...`, which has exactly these settings and bounds.

    Returns:
        The command; None where no shipped scenario with changes gives them.
    """
    try:
        plain = scenarios.load(name, [], seed)
        kinds = _kinds(settings, plain.settings())
        own = _flat(_words(scenarios.load(name, kinds, seed)))
        changes = kinds + [
            f"{key}={_said(value)}"
            for key, value in _flat(settings).items()
            if own.get(key) != value
        ]
        if plain.expect != expect:
            changes += ["expect={}", *(f"expect.{k}={_said(v)}" for k, v in expect.items())]
        again = scenarios.load(name, changes, seed)
    except (Mistake, KeyError, TypeError):  # another version's settings, or a scenario of one's own
        return None
    if _words(again) != settings or again.expect != expect:
        return None
    sets = [word for change in changes for word in ("--set", change)]
    return shlex.join(["servobench", "run", name, *sets, "--seed", str(seed)])


def scenario_file(settings: Settings, expect: dict[str, float | str]) -> str:
    """The same settings as a scenario's file; what is None is its default."""
    whole = settings | {"expect": expect}
    lists = [f"{k} = {toml(v)}" for k, v in whole.items() if isinstance(v, list) and v]
    tables = [
        "\n".join([f"\n[{name}]", *(f"{k} = {toml(v)}" for k, v in table.items() if v is not None)])
        for name, table in whole.items()
        if isinstance(table, dict) and table
    ]
    return "\n".join([*lists, *tables]).strip()


def toml(value: Any) -> str:
    """A value as TOML has it; a None inside a table is left out.

    Raises:
        TypeError: The value is None, which TOML does not have.
    """
    if value is None:
        raise TypeError("TOML has no null")
    if isinstance(value, dict):
        inner = (f"{key} = {toml(item)}" for key, item in value.items() if item is not None)
        return "{" + ", ".join(inner) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value)


def _kinds(settings: Settings, before: Settings) -> list[str]:
    """The changes of what must be chosen before its settings can be changed."""
    chosen = {f"{key}.kind": settings[key]["kind"] for key in PLUGINS
              if settings[key]["kind"] != before[key]["kind"]}  # fmt: skip
    for key in LISTS:
        now, then = ([item["kind"] for item in where[key]] for where in (settings, before))
        if now != then:
            chosen[key] = settings[key]
    return [f"{key}={_said(value)}" for key, value in chosen.items()]


def _flat(table: Settings, begin: str = "") -> Settings:
    """Nested tables by dotted keys; lists of tables by their place."""
    found: Settings = {}
    for key, value in table.items():
        if isinstance(value, list) and any(isinstance(item, dict) for item in value):
            value = {str(i): item for i, item in enumerate(value)}
        found |= _flat(value, f"{begin}{key}.") if isinstance(value, dict) else {begin + key: value}
    return found


def _said(value: Any) -> str:
    """As after --set, where a plain word needs no quotes."""
    return value if isinstance(value, str) and value.isidentifier() else toml(value)


def _words(scenario: Scenario) -> Settings:
    """Its settings as a report has them."""
    return json.loads(json.dumps(scenario.settings(), default=lambda e: e.value))
