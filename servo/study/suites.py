"""Sequences and trackers of a bench: a named suite, a folder of sequences, or a TOML file."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from servo.mistake import Mistake, as_mistake, check_known
from servo.scenario import toml
from servo.scenario.fill import fill_plugin
from servo.study.sequence_run import Contender, Entry, Generated, Recorded
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.sequences.sequence import is_folder
from tracking.sequences.truth import Format
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers import general_kinds

SUITES: dict[str, list[dict[str, Any]]] = {
    "clutter": [{"kind": "clutter", "level": level} for level in "abcd"],
    "hard_clutter": [{"kind": "clutter", "level": level} for level in "efgh"],
    "similarity": [{"kind": "similarity"}],
    "texture": [{"kind": "texture"}],
    "camouflage": [{"kind": "camouflage"}],
}
CLOSED_LOOP = "closed_loop"
KEYS = ("sequences", "trackers")
RECORDED_KEYS = ("path", "truth_format")


def suite(name: str) -> tuple[list[Entry], list[Contender]]:
    """The sequences of a suite, and the trackers that its TOML file may list.

    Args:
        name: A name, a folder or a TOML file.

    Raises:
        Mistake: There is no such suite, or it is wrong.
    """
    if name in SUITES:
        return [_entry(table, name) for table in SUITES[name]], []
    path = Path(name)
    if path.suffix == ".toml":
        return _of_toml(path)
    if not is_folder(path):
        there = ", ".join([*SUITES, CLOSED_LOOP])
        raise Mistake(f"there is no suite '{name}'; there is {there}, or give a folder or a .toml")
    return list(_recorded(path)), []


def contenders(text: str | None) -> list[Contender]:
    """Trackers by "kind" or "kind:preset", separated by commas; None: all trackers.

    A kind of another package may be "package:kind", and a class to import "module:Name".

    Raises:
        Mistake: There is no such tracker or preset.
    """
    words = general_kinds() if text is None else [w.strip() for w in text.split(",")]
    chosen = [TRACKERS.named(word) for word in words]
    return _all_different([_contender(table, "--trackers") for table in chosen], "--trackers")


def tracker_tables(text: str) -> dict[str, dict[str, Any]]:
    """The tables of trackers by their labels; argument and errors are those of `contenders`."""
    labels = [one.label for one in contenders(text)]
    words = [word.strip() for word in text.split(",")]
    return {
        label: {f"tracker.{key}": value for key, value in TRACKERS.named(word).items()}
        for label, word in zip(labels, words, strict=True)
    }


def _contender(table: Any, place: str) -> Contender:
    if not isinstance(table, dict):
        raise Mistake(f"{place} should be a table with a kind, not {table!r}")
    kind = table.get("kind")
    preset = table.get("preset")
    label = table.get("label", f"{kind}-{preset}" if preset else str(kind))
    if not isinstance(label, str):
        raise Mistake(f"{place}.label = {label!r}: this should be a text")
    config = fill_plugin(TRACKERS, {k: v for k, v in table.items() if k != "label"}, place)
    try:
        return Contender(label, config)
    except ValueError as error:
        raise Mistake(f"{place}.label: {error}") from None


def _entry(table: dict[str, Any], place: str) -> Generated:
    return Generated(str(table["kind"]), fill_plugin(GENERATORS, table, place))


def _recorded(folder: Path, form: Format = Format.AUTO) -> Sequence[Recorded]:
    with as_mistake():
        return Recorded.all_in(folder, form)


def _of_toml(path: Path) -> tuple[list[Entry], list[Contender]]:
    table = toml.decode(toml.read(path, "suite"), path.name)
    check_known(table, KEYS, path.name)
    for key, items in table.items():
        if not isinstance(items, list):
            raise Mistake(f"{path.name}: {key} should be a list of tables, not {items!r}")
    entries: list[Entry] = []
    for i, item in enumerate(table.get("sequences", [])):
        entries += _entries(item, path.parent, f"{path.name}: sequences[{i}]")
    if not entries:
        raise Mistake(f"{path.name}: there are no [[sequences]] in this suite")
    double = _double(entry.name for entry in entries)
    if double is not None:
        raise Mistake(
            f"{path.name}: two sequences are called '{double}', and results are kept by name: "
            "leave one out, rename its folder, or put it into another suite"
        )
    chosen = [
        _contender(t, f"{path.name}: trackers[{i}]")
        for i, t in enumerate(table.get("trackers", []))
    ]
    return entries, _all_different(chosen, path.name)


def _all_different(chosen: list[Contender], place: str) -> list[Contender]:
    """Refuse trackers with the same label."""
    double = _double(one.label for one in chosen)
    if double is not None:
        raise Mistake(
            f"{place}: two trackers are called '{double}': leave one out, or give it another label "
            "in a suite's file"
        )
    return chosen


def _double(names: Iterable[str]) -> str | None:
    """A name that occurs twice; None if there is none."""
    return next((name for name, count in Counter(names).items() if count > 1), None)


def _entries(item: Any, beside: Path, place: str) -> Sequence[Entry]:
    """The sequences of an item of [[sequences]]; paths are relative to the suite's folder."""
    if not isinstance(item, dict) or ("path" in item) == ("kind" in item):
        raise Mistake(f"{place} should have either a path or a kind")
    if "kind" in item:
        return [_entry(item, place)]
    check_known(item, RECORDED_KEYS, place)
    for key, value in item.items():
        if not isinstance(value, str):
            raise Mistake(f"{place}.{key} = {value!r}: this should be a text")
    try:
        form = Format.named(item.get("truth_format", "auto"))
    except ValueError as error:
        raise Mistake(f"{place}: {error}") from None
    return _recorded(beside / item["path"], form)
