"""Kinds that other packages bring, named by entry points, and parts named by a path to import.

An installed package adds a tracker with these lines in its pyproject.toml:

    [project.entry-points."servobench.trackers"]
    mine = "my_package.my_module:Config"
"""

import functools
import importlib
import importlib.util
import sys
from collections import defaultdict
from contextlib import suppress
from dataclasses import astuple, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any


class Trusted(str):
    """A text from the command line or from Python.

    It may name code to import or a command to start; a text from a file may not.
    """

    __slots__ = ()


class BrokenPart(ValueError):
    """A part is there but cannot be imported; the message says why."""


@dataclass(frozen=True, slots=True)
class Installed:
    """A kind that an installed package brings."""

    kind: str
    package: str
    """Name of the distribution."""
    version: str
    path: str
    """Where it is, as module:Class."""


GROUPS = "servobench."
"""How the names of our groups of entry points begin."""


@functools.cache  # looking through 130 packages takes 3 ms
def entries() -> dict[str, set[Installed]]:
    """Return the kinds that packages bring, by group.

    Packages whose entry points cannot be read bring none: it may be one that has nothing to do with
    us. So do names with characters that a terminal acts upon.
    """
    found = defaultdict[str, set[Installed]](set)
    for package in metadata.distributions():
        with suppress(Exception):  # another person's file: no UTF-8, no metadata, no name
            text = package.read_text("entry_points.txt") or ""
            first = GROUPS in text and metadata.distribution(package.name)
            if not first or first.read_text("entry_points.txt") != text:
                continue  # it brings nothing, or another one of this name comes first
            for e in package.entry_points:
                path = e.value.partition("[")[0].replace(" ", "")
                kind = Installed(e.name, package.name, package.version, path)
                if e.group.startswith(GROUPS) and e.name and "".join(astuple(kind)).isprintable():
                    found[e.group].add(kind)
    return found


def installed(group: str) -> tuple[Installed, ...]:
    """Return the kinds that packages bring to a group such as "servobench.trackers"."""
    return tuple(sorted(entries().get(group, ()), key=lambda k: (k.kind, k.package)))


def packages() -> dict[str, str]:
    """Return the versions of all packages that bring kinds, by name."""
    return {k.package: k.version for kinds in entries().values() for k in kinds}


def plain(text: str) -> str:
    """Return a text on one line, without what a terminal acts upon."""
    return "".join(filter(str.isprintable, " ".join(text.split())))


def imported(path: str) -> Any:
    """Return the object at a path such as "package.module:Name"; also from the working directory.

    Raises:
        BrokenPart: It cannot be imported; an error of the module itself is the cause.
    """
    module, _, name = path.partition(":")
    if not all(map(str.isidentifier, [*module.split("."), *name.split(".")])):
        example = "my_package.my_module:Config"
        raise BrokenPart(f"'{path}' should be module:Name, such as {example}")
    importlib.invalidate_caches()  # the module may have been written a moment ago
    try:
        if importlib.util.find_spec(module.partition(".")[0]) is None:
            sys.path.append(str(Path.cwd()))
        found = importlib.import_module(module)
        for part in name.split("."):
            found = getattr(found, part)
    except (Exception, SystemExit) as error:  # an import runs the user's code
        reason = plain(str(error)) or type(error).__name__
        raise BrokenPart(f"'{path}' cannot be imported: {reason}") from error
    return found
