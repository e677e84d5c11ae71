"""Components that other packages add by entry points, and components named by a path to import.

An installed package adds a tracker with these lines in its pyproject.toml:

    [project.entry-points."servobench.trackers"]
    mine = "my_package.my_module:Config"
"""

import functools
import importlib
import importlib.util
import sys
from contextlib import suppress
from dataclasses import astuple, dataclass
from importlib import metadata
from itertools import chain
from pathlib import Path


class Trusted(str):
    """A text that came from the command line or from Python, and may therefore name code to import
    or a command to start. A plain `str`, such as one read from a scenario's file, may not.
    """

    __slots__ = ()


class BrokenPart(ValueError):
    """Error: a component (such as a tracker) cannot be imported; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class Installed:
    """A component, such as a tracker, that an installed package adds to servobench by an entry
    point: the entry point's group and name (`kind`), the package's name and version, and the import
    path of the component's class, "module:Class".
    """

    group: str
    """Group of its entry point, such as "servobench.trackers"."""
    kind: str
    package: str
    """Name of the distribution."""
    version: str
    path: str
    """Path to import, as module:Class."""


GROUPS = "servobench."
"""Prefix of the names of our groups of entry points."""


@functools.cache  # looking through 130 packages takes 3 ms
def entries() -> tuple[Installed, ...]:
    """Return the components (trackers, controllers, ...) that all installed packages add by entry
    points, whose groups begin with "servobench.".

    A package with damaged metadata is skipped, while `importlib.metadata.entry_points` would fail
    for all. Entry points with control characters are skipped too. Of two packages with the same
    name, the first one found counts. The packages are searched once in a process.
    """
    found = dict[str, list[Installed]]()
    for package in metadata.distributions():
        with suppress(Exception):  # another person's file: no UTF-8, no metadata, no name
            # Most packages are ruled out by this text; parsing each one's metadata takes longer.
            if GROUPS in (package.read_text("entry_points.txt") or ""):
                found.setdefault(package.name, _kinds_of(package))
    return tuple(chain.from_iterable(found.values()))


def _kinds_of(package: metadata.Distribution) -> list[Installed]:
    """Return the kinds of a package, without names that contain control characters, upon which a
    terminal acts.
    """
    kinds = [
        Installed(e.group, e.name, package.name, package.version, f"{e.module}:{e.attr}")
        for e in package.entry_points
        if e.group.startswith(GROUPS) and e.name
    ]
    return [kind for kind in kinds if "".join(astuple(kind)).isprintable()]


def installed(group: str) -> tuple[Installed, ...]:
    """Return the components that installed packages add to a group of entry points such as
    "servobench.trackers", sorted by the entry points' names, then by the packages' names.
    """
    added = (kind for kind in entries() if kind.group == group)
    return tuple(sorted(added, key=lambda k: (k.kind, k.package)))


def packages() -> dict[str, str]:
    """Return the version of each installed package that adds components (trackers, controllers,
    ...), as a dictionary by the package's name.
    """
    return {kind.package: kind.version for kind in entries()}


def plain(text: str) -> str:
    """Return a text on one line, with single spaces, and without control characters, which could
    change a terminal's state.
    """
    return "".join(filter(str.isprintable, " ".join(text.split())))


def imported(path: str) -> object:
    """Import a module and return an object in it, given a path such as "package.module:Name". If
    the package is not found elsewhere, the working directory is added to the end of `sys.path`, and
    stays there.

    Raises:
        BrokenPart: The path has another form, or the object cannot be imported; an error in the
            module is the exception's cause.
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
