"""What a bench runs: a named suite, a folder of sequences, or a TOML file that lists them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from servo.mistake import Mistake, unknown
from servo.parsing import fill_plugin
from sim import plugins
from tracking.evaluation.bench import Contender, Entry, Generated, Recorded
from tracking.evaluation.sequence import read_all
from tracking.evaluation.sources import RATE

GENERATORS, TRACKERS = "tracking.evaluation.generators", "tracking.trackers"
CLUTTER = [{"kind": "clutter", "level": level} for level in "abcd"]
SUITES: dict[str, list[dict[str, Any]]] = {
    "clutter": CLUTTER,
    "similarity": [{"kind": "similarity"}],
    "texture": [{"kind": "texture"}],
}
CLOSED_LOOP = "closed_loop"
KEYS = ("sequences", "trackers")


def suite(name: str) -> tuple[list[Entry], list[Contender]]:
    """Sequences, and the trackers that a TOML file may list.

    Raises:
        Mistake: There is no such suite, or something is wrong in it.
    """
    if name in SUITES:
        return [_entry(table, name) for table in SUITES[name]], []
    path = Path(name)
    if path.suffix == ".toml":
        return _of_toml(path)
    if not path.is_dir():
        there = ", ".join([*SUITES, CLOSED_LOOP])
        raise Mistake(f"there is no suite '{name}'; there is {there}, or give a folder or a .toml")
    return list(_recorded(path)), []


def contenders(text: str | None) -> list[Contender]:
    """Trackers by "kind" or "kind:preset", separated by commas; all of them for None.

    Raises:
        Mistake: There is no such tracker or preset.
    """
    words = plugins.kinds(TRACKERS) if text is None else [w.strip() for w in text.split(",")]
    tables: list[dict[str, Any]] = []
    for word in words:
        kind, colon, preset = word.partition(":")
        tables.append({"kind": kind} | ({"preset": preset} if colon else {}))
    return [_contender(table, "--trackers") for table in tables]


def _contender(table: Any, place: str) -> Contender:
    if not isinstance(table, dict):
        raise Mistake(f"{place} should be a table with a kind, not {table!r}")
    kind, preset = table.get("kind"), table.get("preset")
    usual = f"{kind}-{preset}" if preset else str(kind)
    settings = {k: v for k, v in table.items() if k != "label"}
    return Contender(str(table.get("label", usual)), fill_plugin(TRACKERS, settings, place))


def _entry(table: dict[str, Any], place: str) -> Generated:
    return Generated(str(table["kind"]), fill_plugin(GENERATORS, table, place))


def _recorded(folder: Path) -> Sequence[Recorded]:
    try:
        return [Recorded(folder, s.name) for s in read_all(folder, RATE)]
    except ValueError as error:
        raise Mistake(str(error)) from None


def _of_toml(path: Path) -> tuple[list[Entry], list[Contender]]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise Mistake(f"{path}: cannot read this suite: {reason}") from None
    except tomllib.TOMLDecodeError as error:
        raise Mistake(f"{path}: this is not TOML: {error}") from None
    for key in table:
        if key not in KEYS:
            raise Mistake(f"{path.name}: {unknown(key, KEYS)}")
    entries: list[Entry] = []
    for i, item in enumerate(table.get("sequences", [])):
        place = f"{path.name}: sequences[{i}]"
        if not isinstance(item, dict) or ("path" in item) == ("kind" in item):
            raise Mistake(f"{place} should have either a path or a kind")
        entries += (
            _recorded(path.parent / item["path"]) if "path" in item else [_entry(item, place)]
        )
    if not entries:
        raise Mistake(f"{path.name}: there are no [[sequences]] in this suite")
    chosen = [_contender(t, f"{path.name}: trackers[{i}]")
              for i, t in enumerate(table.get("trackers", []))]  # fmt: skip
    return entries, chosen
