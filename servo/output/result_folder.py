"""A folder to which several sessions of one command add results, with one writer at a time.

`begun.json` holds the command and the versions of the first session. Other commands and versions
are refused: their results could not be compared with those in the folder.
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
    """begun.json: the command and the versions of a folder's results."""

    FILE: ClassVar[str] = "begun.json"
    KIND: ClassVar[str] = "begun"

    holds: str
    """The command: "bench", "bench closed_loop" or "papers"."""
    versions: dict[str, str]


@contextmanager
def result_folder(folder: Path, command: str) -> Generator[None]:
    """Make a folder or continue in it, and lock it until the block ends; `command` is that whose
    results it holds: "bench", "bench closed_loop" or "papers".

    Raises:
        Mistake: It holds something else or results of other versions, another process is writing
            into it, or it cannot be written.
        Refused: A file could not be written in the block.
    """
    with only_writer(folder, Begun, command) as found:
        if found is None:
            try:
                Begun(holds=command, versions=versions()).write(folder)
            except OSError as error:
                raise unwritable(folder, error) from None
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
    """Make a folder, and lock it until the block ends; nothing is written into it if it belongs to
    another command. Yields the file that the first session wrote; None if there is none.

    `own` names empty folders that a first session may leave when it is killed early.

    Raises:
        Mistake: Another process is writing into it, it cannot be written, or it holds something
            else.
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
    """The file that a folder's first session wrote; arguments as for `only_writer`."""
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
            f"{path}: this file is damaged, so the results beside it cannot be identified; "
            "choose another folder with --out"
        ) from None


def check_versions(folder: Path, before: dict[str, str], now: dict[str, str]) -> None:
    """Refuse to add results to a folder of other versions.

    Raises:
        Mistake: A package or our own source differs; the message names it.
    """
    for name, version in now.items():
        if before.get(name) != version:
            raise Mistake(
                f"{folder}: this was begun with {name} {before.get(name)}, but {version} is "
                "installed: the numbers could not be compared; choose another folder with --out"
            )


def _of_the_beginning(path: Path, name: str, own: Collection[str]) -> bool:
    empty = path.name in own and path.is_dir() and not any(path.iterdir())
    return empty or path.name in (LOCK, atomic.ASIDE.format(name))
