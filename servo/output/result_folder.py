"""A folder that results are added to over several sessions: whose it is, and one writer at a time.

`begun.json` says which command began it, with which versions: results of other code would not
compare, and another command's results would be mixed with these.
"""

from __future__ import annotations

from collections.abc import Collection, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, TypeVar

from filelock import FileLock, Timeout

from servo.mistake import Mistake, Refused, unwritable
from servo.output.formats import Document, OtherFormat
from servo.output.versions import versions
from tracking.files import atomic

LOCK = ".lock"
GOES_ON = "the same command goes on from there"
Beginning = TypeVar("Beginning", bound=Document)


@dataclass(frozen=True, slots=True, kw_only=True)
class Begun(Document):
    """Whose results a folder holds."""

    FILE: ClassVar[str] = "begun.json"
    KIND: ClassVar[str] = "begun"
    FORMAT: ClassVar[int] = 1

    holds: str
    """The command: "bench", "bench closed_loop" or "papers"."""
    versions: dict[str, str]


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
    with only_writer(folder, Begun, command) as found:
        if found is None:
            _write(folder, Begun(holds=command, versions=versions()))
        elif found.holds != command:
            raise Mistake(
                f"{folder}: this folder holds results of another command; choose another folder "
                "with --out"
            )
        else:
            check_versions(folder, found.versions, versions())
        try:
            yield
        except OSError as error:
            raise Refused.by(error, f"what is in {folder} is whole; {GOES_ON}") from None


@contextmanager
def only_writer(
    folder: Path, kind: type[Beginning], command: str, own: Collection[str] = ()
) -> Generator[Beginning | None]:
    """Make a folder, and keep others from writing into it until the block ends.

    Args:
        folder: Which. Nothing is written into one that is not the command's.
        kind: Of the file that says whose it is.
        command: Which command goes on here.
        own: Folders that may be there, empty, where the first session was killed at once.

    Yields:
        What the first session wrote about it; None for a folder that is still empty.

    Raises:
        Mistake: Somebody is writing there, it cannot be written, or holds something else.
    """
    try:
        if folder.is_dir():
            _manifest(folder, kind, command, own)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK)
        lock.acquire(blocking=False)
    except Timeout:
        raise Mistake(f"{folder}: another command is writing into this folder") from None
    except OSError as error:
        raise unwritable(folder, error) from None
    try:
        yield _manifest(folder, kind, command, own)
    finally:
        lock.release()


def _manifest(
    folder: Path, kind: type[Beginning], command: str, own: Collection[str]
) -> Beginning | None:
    """What a folder's first session wrote about it; arguments as for `only_writer`.

    Raises:
        Mistake: The file is damaged or of another format, or missing though the folder holds
            something.
    """
    path = folder / kind.FILE
    if not path.exists():
        if any(not _of_the_beginning(there, kind.FILE, own) for there in folder.iterdir()):
            raise Mistake(
                f"{folder}: there is something in this folder, but no {kind.FILE} of `servobench "
                f"{command}`; choose another folder with --out"
            )
        return None
    try:
        return kind.read(path)
    except OtherFormat as error:
        raise Mistake(f"{error.fact}; choose another folder with --out") from None
    except Mistake:
        raise Mistake(
            f"{path}: this file is damaged, so that nobody knows what the results beside "
            "it are; choose another folder with --out"
        ) from None


def check_versions(folder: Path, before: dict[str, str], now: dict[str, str]) -> None:
    """Refuse to add results to those of other versions.

    Raises:
        Mistake: A package or our own source differs; the message says which.
    """
    for name, version in now.items():
        if before.get(name) != version:
            raise Mistake(
                f"{folder}: this was begun with {name} {before.get(name)}, here is {version}: its "
                "numbers would not compare; choose another folder with --out"
            )


def _of_the_beginning(path: Path, name: str, own: Collection[str]) -> bool:
    empty = path.name in own and path.is_dir() and not any(path.iterdir())
    return empty or path.name in (LOCK, atomic.ASIDE.format(name))


def _write(folder: Path, begun: Begun) -> None:
    try:
        begun.write(folder)
    except OSError as error:
        raise unwritable(folder, error) from None
