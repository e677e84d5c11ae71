"""Names of trackers and control laws on the command line, such as kams:paper (KIND:PRESET),
module:Class or trax:COMMAND, and the settings that they stand for.
"""

import json

from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS
from sim.installed import Trusted

Settings = dict[str, object]
"""Settings by dotted key, such as "tracker.kind"."""
TRAX = "trax:"
"""Begins the command of a program that speaks TraX."""
PROGRAM = "program:"
"""Begins the command of a program that speaks lines of JSON: a tracker, or a policy."""
ONNX = "onnx:"
"""Begins the files of a network: of a tracker of OpenCV, or of a learned control law."""
NETWORKS = {1: "Vit", 2: "Nano", 3: "DaSiamRPN"}
"""OpenCV's trackers by the number of their network files."""
DOORS = {"tracker": (PROGRAM, TRAX, ONNX), "controller": (PROGRAM, ONNX)}
"""Prefixes that a text for a component may have, by section; other texts name a kind or a class."""
FORMS = {PROGRAM: "'program:COMMAND'", TRAX: "'trax:COMMAND'", ONNX: "onnx:FILE"}
"""Forms of the texts with these prefixes, by prefix, for messages."""


def named_part(section: str, text: str) -> tuple[str, str]:
    """Split a text NAME=PART, such as "mine=package:Class", and return the name and the part, which
    is a tracker or a control law; a text without "=" is both, and so is one with a colon before its
    first "=", such as "program:mine --rate=3".

    Args:
        section: The section of a scenario that the part is for, such as "tracker"; it is used only
            in messages.
        text: The text.

    Raises:
        Mistake: The name or the part is missing.
    """
    name, separator, what = text.partition("=")
    if not separator or ":" in name:
        name = what = text
    if not name.strip() or not what.strip():
        parts = ["KIND", "module:Class", *(FORMS[begin] for begin in DOORS.get(section, ()))]
        *first, last = (f"NAME={part}" for part in parts)
        raise Mistake(
            f"'{text}': the name before the = or the component after it is missing; write "
            f"{', '.join(first)} or {last}"
        )
    return name.strip(), what.strip()


def settings_of(section: str, what: str) -> Settings:
    """Return the settings, by dotted key such as "tracker.kind", that put a component into a
    section of a scenario.

    Args:
        section: The section, such as "tracker" or "controller".
        what: The component: kind, kind:preset, module:Class or program:COMMAND; for a tracker also
            trax:COMMAND or onnx:FILE[,FILE[,FILE]], whose number of files selects OpenCV's tracker
            (1: Vit, 2: Nano, 3: DaSiamRPN), and for a controller onnx:FILE.

    Raises:
        Mistake: The command or the file is missing, or there are too many files.
    """
    table = _table(section, what)
    return {f"{section}.{key}": value for key, value in table.items()}


def changes_of(tracker: str | None, controller: str | None) -> list[str]:
    """Return changes of settings, such as 'tracker.kind="kams"', as the option --set takes them,
    that put a tracker and a controller into a scenario.

    Args:
        tracker: The tracker as on the command line, such as "kams:paper" (KIND:PRESET) or
            "module:Class"; None: the scenario's own stays.
        controller: The controller likewise.

    Raises:
        Mistake: A command or a file is missing, or there are too many files.
    """
    given = {"tracker": tracker, "controller": controller}
    return [
        f"{key}={json.dumps(value)}"
        for section, what in given.items()
        if what is not None
        for key, value in settings_of(section, what).items()
    ]


def _table(section: str, what: str) -> Settings:
    """Return the settings of a part by their names in its section; for arguments and errors see
    `settings_of`.
    """
    kind, colon, given = what.partition(":")
    begin, given = kind + colon, given.strip()
    if begin not in DOORS.get(section, ()):
        return {**PLUGINS[section][0].named(what)}
    if not given:
        raise Mistake(f"'{what}': write the {'file' if begin == ONNX else 'command'} after it")
    if begin != ONNX:
        return {"kind": kind, "command": Trusted(given)}
    if section == "controller":
        return {"kind": "onnx", "file": given}
    files = given.split(",")
    if len(files) not in NETWORKS:
        raise Mistake(
            f"'{what}': OpenCV has no tracker with {len(files)} network files: give one, "
            "two or three"
        )
    model = files[0] if len(files) == 1 else files
    return {"kind": "opencv", "name": NETWORKS[len(files)], "model": model}
