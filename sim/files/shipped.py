"""Files that a setting names: a file of the user, or one that is shipped in the package
`scenes`.
"""

from importlib import resources
from pathlib import Path

from sim.files.notices import Notice, notice
from sim.files.packages import is_file

FOLDER_NAMES = (".", "..")
"""Names that are always paths, though they have no slash."""
FOLDERS = ("robots", "targets", "grounds")
"""Folders of the shipped robots, targets and pictures of grounds in `scenes`."""


class SameName(Notice):
    """A warning that a file of the user and a shipped file have the same name; it says which of
    them is used.
    """


def file_of(name: str, folder: str, suffix: str, setting: str) -> Path:
    """Return the path of the file that a setting names: a shipped file by its bare name, else the
    name as a path, which need not exist.

    A name with a slash is always a path. The full name of a shipped file, such as "duck.obj",
    selects it unless the working directory has a file of this name. A warning says which file is
    used if a bare name selects a shipped file though the working directory has one of its full
    name, or if the user's file is used though a shipped robot, target or ground has its name.

    Args:
        name: Such as "duck", "duck.obj" or "mine/duck.obj".
        folder: Folder of the shipped files in the package `scenes`, such as "targets".
        suffix: Suffix of the shipped files, such as ".obj".
        setting: Name of the setting for error messages, such as "file".

    Raises:
        ValueError: The name has neither slash nor suffix, and no shipped file and none in the
            working directory has this name.
    """
    own = Path(name)
    files = (resources.files("scenes") / folder).iterdir()
    shipped = {f.name: Path(str(f)) for f in files if f.name.endswith(suffix)}
    found = shipped.get(name if own.suffix else name + suffix)
    if "/" in name or name in FOLDER_NAMES or (is_file(own) and (own.suffix or not found)):
        warn_of_shipped(name)
        return own
    if not found and not own.suffix:
        there = ", ".join(sorted(file.removesuffix(suffix) for file in shipped))
        raise ValueError(
            f"{setting} = {name!r}: no file of this name is shipped; give {there}, or a path"
        )
    if not own.suffix:
        warn_of_own(name, name + suffix, setting)
    return found or own


def warn_of_shipped(name: str) -> None:
    """Warn that the user's own file `name` is used, if a shipped robot, target or ground has a file
    of the same name; do nothing if the name has a slash.
    """
    if "/" not in name and any(
        (resources.files("scenes") / folder / name).is_file() for folder in FOLDERS
    ):
        notice(f"{name} is your file of this name, not the shipped one", SameName)


def warn_of_own(name: str, file: str, what: str) -> None:
    """Warn that a bare name such as "duck" selects something shipped, if the working directory has
    a file that the user may have meant.

    Args:
        name: The bare name.
        file: Name of the user's possible file, such as "duck.obj".
        what: Name of the setting, for the message.
    """
    if is_file(Path(file)):
        notice(
            f"{what} = {name!r} is the shipped one, not your {file}: write {file} for that",
            SameName,
        )
