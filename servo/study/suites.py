"""Sequences and trackers of a bench: a named suite, a folder of sequences, or a TOML file."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

from annotated_types import MinLen
from pydantic import BaseModel

from servo.mistake import Mistake, as_mistake
from servo.scenario import toml
from servo.scenario.fill import STRICT, fill_plugin, validated
from servo.scenario.toml import Table
from servo.study.sequence_run import Contender, Entry, Generated, Recorded
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.sequences.sequence import is_folder
from tracking.sequences.truth import Format
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers import general_kinds

SUITES: dict[str, list[Table]] = {
    "clutter": [{"kind": "clutter", "level": level} for level in "abcd"],
    "hard_clutter": [{"kind": "clutter", "level": level} for level in "efgh"],
    "similarity": [{"kind": "similarity"}],
    "texture": [{"kind": "texture"}],
    "camouflage": [{"kind": "camouflage"}],
}
CLOSED_LOOP = "closed_loop"


class SuiteTable(BaseModel):
    """The keys of a suite's file."""

    model_config = STRICT
    sequences: Annotated[list[Table], MinLen(1)]
    """Each with a path, or with a kind and its settings."""
    trackers: list[Table] = []


class RecordedTable(BaseModel):
    """Recorded sequences in a suite's file."""

    model_config = STRICT
    path: str
    """A folder, relative to that of the suite's file."""
    truth_format: str = "auto"


def suite(name: str) -> tuple[list[Entry], list[Contender]]:
    """Return the sequences of a suite, and the trackers that its TOML file may list.

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
    """Return trackers by "kind" or "kind:preset", separated by commas; None: all trackers.

    A kind of another package may be "package:kind", and a class to import "module:Name".

    Raises:
        Mistake: There is no such tracker or preset.
    """
    words = general_kinds() if text is None else [w.strip() for w in text.split(",")]
    chosen = [TRACKERS.named(word) for word in words]
    return _all_different([_contender(table, "--trackers") for table in chosen], "--trackers")


def tracker_tables(text: str) -> dict[str, Table]:
    """Return tables of settings of trackers by label; `text` and errors are as for `contenders`."""
    labels = [one.label for one in contenders(text)]
    words = [word.strip() for word in text.split(",")]
    return {
        label: {f"tracker.{key}": value for key, value in TRACKERS.named(word).items()}
        for label, word in zip(labels, words, strict=True)
    }


def _contender(table: Mapping[str, object], place: str) -> Contender:
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


def _entry(table: Table, place: str) -> Generated:
    return Generated(str(table["kind"]), fill_plugin(GENERATORS, table, place))


def _recorded(folder: Path, form: Format = Format.AUTO) -> Sequence[Recorded]:
    with as_mistake():
        return Recorded.all_in(folder, form)


def _of_toml(path: Path) -> tuple[list[Entry], list[Contender]]:
    file = validated(SuiteTable, toml.decode(toml.read(path, "suite"), path.name), f"{path.name}: ")
    entries: list[Entry] = []
    for i, item in enumerate(file.sequences):
        entries += _entries(item, path.parent, f"{path.name}: sequences[{i}]")
    double = _double(entry.name for entry in entries)
    if double is not None:
        raise Mistake(
            f"{path.name}: two sequences are called '{double}', and results are kept by name: "
            "leave one out, rename its folder, or put it into another suite"
        )
    chosen = [_contender(t, f"{path.name}: trackers[{i}]") for i, t in enumerate(file.trackers)]
    return entries, _all_different(chosen, path.name)


def _all_different(chosen: list[Contender], place: str) -> list[Contender]:
    """Return trackers, whose labels should be different."""
    double = _double(one.label for one in chosen)
    if double is not None:
        raise Mistake(
            f"{place}: two trackers are called '{double}': leave one out, or give it another label "
            "in a suite's file"
        )
    return chosen


def _double(names: Iterable[str]) -> str | None:
    """Return a name that occurs twice; None where all are different."""
    return next((name for name, count in Counter(names).items() if count > 1), None)


def _entries(item: Table, beside: Path, place: str) -> Sequence[Entry]:
    """Return the sequences of an item of [[sequences]].

    Args:
        item: As TOML has it.
        beside: The folder of the suite's file, which paths are relative to.
        place: The item's place, for messages.
    """
    if ("path" in item) == ("kind" in item):
        raise Mistake(f"{place} should have either a path or a kind")
    if "kind" in item:
        return [_entry(item, place)]
    recorded = validated(RecordedTable, item, f"{place}.")
    try:
        form = Format.named(recorded.truth_format)
    except ValueError as error:
        raise Mistake(f"{place}: {error}") from None
    return _recorded(beside / recorded.path, form)
