"""Suites: sets of sequences of pictures on which trackers are compared, given by a shipped name, by
a folder of recordings or by a TOML file.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

from annotated_types import MinLen
from pydantic import BaseModel

from servo.mistake import Mistake, as_mistake, check_rules
from servo.scenario import toml
from servo.scenario.fill import STRICT, fill_plugin, validated
from servo.scenario.part_names import named_part, settings_of
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
LABEL = "label"
LABELLED = re.compile("[^:=]+=")
"""The beginning of a tracker of the command line that has a label of its own."""


class SuiteTable(BaseModel):
    """The keys of a suite's TOML file, as pydantic checks them: the tables of its sequences (each
    with a `path` of recordings, or a `kind` of painted sequence) and of its trackers, if it lists
    any.
    """

    model_config = STRICT
    sequences: Annotated[list[Table], MinLen(1)]
    """Recorded sequences with a `path`, or painted ones with a `kind` and its settings."""
    trackers: list[Table] = []
    """Trackers with a `kind`, its settings, and a `label` for tables."""


class RecordedTable(BaseModel):
    """The keys of a table [[sequences]] with recordings, as pydantic checks them: their folder,
    relative to that of the suite's file, and the format of its truth files.
    """

    model_config = STRICT
    path: str
    """A folder, relative to that of the suite's file."""
    truth_format: str = "auto"


def suite(name: str) -> tuple[list[Entry], list[Contender]]:
    """Return the sequences of a suite, and the trackers that its TOML file lists (else an empty
    list).

    Args:
        name: Name of a shipped suite such as "clutter" (but not "closed_loop", which has no
            sequences), or path of a folder of recorded sequences or of a TOML file.

    Raises:
        Mistake: There is no such suite, or its file or a sequence is wrong.
    """
    if name in SUITES:
        return [_entry(table, name) for table in SUITES[name]], []
    path = Path(name)
    if path.suffix == ".toml":
        return _of_toml(path)
    if not is_folder(path):
        there = ", ".join([*SUITES, CLOSED_LOOP])
        raise Mistake(f"there is no suite '{name}'; give {there}, a folder or a .toml file")
    return list(_recorded(path)), []


def contenders(text: str | None) -> list[Contender]:
    """Return the trackers that a text lists, separated by commas. None stands for all trackers that
    can follow any target by pictures and the camera's motion alone, and need no program or model
    file of the user.

    In the text a tracker is "kind", "kind:preset", "package:kind" for a kind of another package,
    "module:Name" for a class to import, "program:COMMAND", "trax:COMMAND" or "onnx:FILE"; "NAME="
    before it gives it another label.

    Raises:
        Mistake: There is no such tracker or preset, one is listed twice, or its name is too long
            for the name of a folder.
    """
    words = general_kinds() if text is None else _words(text)
    found = [_contender(_table(word), "--trackers") for word in words]
    _check_unique((one.label for one in found), "trackers", "--trackers")
    return found


def tracker_tables(text: str) -> dict[str, Table]:
    """Return the settings of listed trackers, such as {"tracker.kind": "kams"}, by the tracker's
    label.

    Args:
        text: Trackers, separated by commas, in the forms that `contenders` takes.

    Raises:
        Mistake: There is no such tracker or preset, one is listed twice, its command or file is
            missing, or its label cannot be the name of a folder.
    """
    labels = [one.label for one in contenders(text)]
    tables = [_table(word) for word in _words(text)]
    return {
        label: {f"tracker.{key}": value for key, value in table.items() if key != LABEL}
        for label, table in zip(labels, tables, strict=True)
    }


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",")]


def _table(word: str) -> Table:
    """Return the settings of a tracker of the command line, with its label if the word has one.

    Raises:
        Mistake: There is no such tracker or preset, or its command or file is missing.
    """
    name, what = named_part("tracker", word) if LABELLED.match(word) else ("", word)
    settings = settings_of("tracker", what)
    table = {key.removeprefix("tracker."): value for key, value in settings.items()}
    return table | {LABEL: name} if name else table


def _contender(table: Mapping[str, object], place: str) -> Contender:
    """Return the tracker of a table with `kind`, settings and `label`; `place` begins messages.

    Raises:
        Mistake: The kind, a setting or the label is wrong.
    """
    kind = table.get("kind")
    preset = table.get("preset")
    label = table.get(LABEL, f"{kind}-{preset}" if preset else str(kind))
    if not isinstance(label, str):
        raise Mistake(f"{place}.label = {label!r}: expected a text")
    config = fill_plugin(TRACKERS, {k: v for k, v in table.items() if k != LABEL}, place)
    try:
        return Contender(label, config)
    except ValueError as error:
        raise Mistake(f"{place}.label: {error}") from None


def _entry(table: Table, place: str) -> Generated:
    """Return the kind of painted (synthetic) sequence that a table with `kind` and settings
    describes; `place` begins messages.

    Raises:
        Mistake: The kind or a setting is wrong.
    """
    return Generated(str(table["kind"]), fill_plugin(GENERATORS, table, place))


def _recorded(folder: Path, form: Format = Format.AUTO) -> Sequence[Recorded]:
    """Return the recorded sequences in a folder.

    Raises:
        Mistake: There is no sequence, or one cannot be read.
    """
    with as_mistake():
        return Recorded.all_in(folder, form)


def _of_toml(path: Path) -> tuple[list[Entry], list[Contender]]:
    """Read the sequences and trackers in a suite's TOML file.

    Raises:
        Mistake: The file or a recorded sequence cannot be read, a table in the file is wrong, or
            two sequences or two trackers have the same name.
    """
    file = validated(SuiteTable, toml.decode(toml.read(path, "suite"), path.name), f"{path.name}: ")
    entries: list[Entry] = []
    for i, item in enumerate(file.sequences):
        entries += _entries(item, path.parent, f"{path.name}: sequences[{i}]")
    chosen = [_contender(t, f"{path.name}: trackers[{i}]") for i, t in enumerate(file.trackers)]
    _check_unique((entry.name for entry in entries), "sequences", path.name)
    _check_unique((one.label for one in chosen), "trackers", path.name)
    return entries, chosen


def _check_unique(names: Iterable[str], what: str, place: str) -> None:
    """Check that the names of sequences or the labels of trackers differ from each other.

    Raises:
        Mistake: Two are equal; the message begins with `place`.
    """
    check_rules(
        *(
            (
                count > 1,
                f"{place}: two {what} are called '{name}': leave one out, or rename it: a recorded "
                "sequence by its folder, a tracker by its label in a suite's file",
            )
            for name, count in Counter(names).items()
        )
    )


def _entries(item: Table, beside: Path, place: str) -> Sequence[Entry]:
    """Return the sequences of one table [[sequences]] in a suite's file.

    Args:
        item: The table, as read from TOML.
        beside: Folder of the suite's file, to which paths are relative.
        place: The table's place, which begins messages.

    Raises:
        Mistake: The table has neither or both of `path` and `kind`, a setting is wrong, or the
            recorded sequences cannot be read.
    """
    if ("path" in item) == ("kind" in item):
        count = "both" if "path" in item else "neither"
        raise Mistake(f"{place} should have either a path or a kind; it has {count}")
    if "kind" in item:
        return [_entry(item, place)]
    recorded = validated(RecordedTable, item, f"{place}.")
    try:
        form = Format.named(recorded.truth_format)
    except ValueError as error:
        raise Mistake(f"{place}: {error}") from None
    return _recorded(beside / recorded.path, form)
