"""A folder that results are added to over several sessions: whose it is, and one writer at a time.

`begun.json` says which command began it, with which versions: results of other code would not
compare, and another command's results would be mixed with these.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from servo.mistake import Mistake, Refused, unwritable
from servo.output.versions import versions
from tracking.files import atomic, reading

BEGUN, LOCK = "begun.json", ".lock"
MOST_BYTES = 1_000_000_000
"""The table of a study and all its scenarios are smaller."""
GOES_ON = "the same command goes on from there"


@contextmanager
def result_folder(folder: Path, command: str) -> Generator[None]:
    """Begin a folder or go on in it; nobody else writes there until the block ends.

    Args:
        folder: Which; made if need be.
        command: Which command's results it holds: "bench" or "papers".

    Raises:
        Mistake: It holds something else, was begun with other versions, somebody is writing there,
            or it cannot be written.
        Refused: The disk refused something in the block.
    """
    with only_writer(folder, BEGUN, command) as found:
        if found is None:
            _write(folder, {"command": command, "versions": versions()})
        elif found.get("command") != command:
            raise Mistake(
                f"{folder}: this folder holds results of another command; choose another folder "
                "with --out"
            )
        else:
            check_versions(folder, found.get("versions"), versions())
        try:
            yield
        except OSError as error:
            raise Refused.by(error, f"what is in {folder} is whole; {GOES_ON}") from None


@contextmanager
def only_writer(
    folder: Path, name: str, command: str, own: Collection[str] = ()
) -> Generator[dict[str, Any] | None]:
    """Make a folder, and keep others from writing into it until the block ends.

    Args:
        folder: Which. Nothing is written into one that is not the command's.
        name: Of the file that says whose it is.
        command: Which command goes on here.
        own: Folders that may be there, empty, where the first session was killed at once.

    Yields:
        What the first session wrote about it; None for a folder that is still empty.

    Raises:
        Mistake: Somebody is writing there, it cannot be written, or holds something else.
    """
    try:
        if folder.is_dir():
            _manifest(folder, name, command, own)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK)
        lock.acquire(blocking=False)
    except Timeout:
        raise Mistake(f"{folder}: another command is writing into this folder") from None
    except OSError as error:
        raise unwritable(folder, error) from None
    try:
        yield _manifest(folder, name, command, own)
    finally:
        lock.release()


def _manifest(folder: Path, name: str, command: str, own: Collection[str]) -> dict[str, Any] | None:
    """What a folder's first session wrote about it; arguments as for `only_writer`.

    Raises:
        Mistake: The file is damaged, or missing though the folder holds something.
    """
    path = folder / name
    if not path.exists():
        if any(not _of_the_beginning(there, name, own) for there in folder.iterdir()):
            raise Mistake(
                f"{folder}: there is something in this folder, but no {name} of `servobench "
                f"{command}`; choose another folder with --out"
            )
        return None
    try:
        found = json.loads(reading.text(path, "file", MOST_BYTES))
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise Mistake(
            f"{path}: this file is damaged, so that nobody knows what the results beside "
            "it are; choose another folder with --out"
        )
    return found


def check_versions(folder: Path, before: Any, now: dict[str, str]) -> None:
    """Refuse to add results to those of other versions.

    Raises:
        Mistake: A package or our own source differs; the message says which.
    """
    kept: dict[str, Any] = before if isinstance(before, dict) else {}
    for name, version in now.items():
        if kept.get(name) != version:
            raise Mistake(
                f"{folder}: this was begun with {name} {kept.get(name)}, here is {version}: its "
                "numbers would not compare; choose another folder with --out"
            )


def _of_the_beginning(path: Path, name: str, own: Collection[str]) -> bool:
    empty = path.name in own and path.is_dir() and not any(path.iterdir())
    return empty or path.name in (LOCK, atomic.ASIDE.format(name))


def _write(folder: Path, begun: dict[str, Any]) -> None:
    try:
        atomic.write(folder, BEGUN, json.dumps(begun, indent=1) + "\n")
    except OSError as error:
        raise unwritable(folder, error) from None
