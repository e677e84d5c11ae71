"""The JSON files that servobench writes: each kind of file is a frozen dataclass, which writes and
reads it.
"""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Self, TypeVar

from annotated_types import Ge, Le
from pydantic import TypeAdapter, ValidationError

from servo.mistake import Mistake, as_mistake
from sim.files import reading
from tracking.files import atomic
from tracking.files.json_text import as_json, json_text

LARGEST = 1_000_000_000
"""Largest file [bytes]."""
ABSURD = 1e100
"""Largest number in a file; a larger one cannot be drawn."""
Number = Annotated[float, Ge(-ABSURD), Le(ABSURD)]
RUN_AGAIN = "repeat the command that wrote it, into a new folder"
HALF_WRITTEN = f"it may be half-written: {RUN_AGAIN}"
"""Ends of messages about a file that is not as it was written: what to do."""
T = TypeVar("T")


class OtherFormat(Mistake):
    """Error: a file has another format number (`found`; None: it has none) than the one that this
    version of servobench reads (`number`). `fact` is the sentence without advice.
    """

    def __init__(self, path: Path, found: object, number: int) -> None:
        has = "has no format number" if found is None else f"has format {found!r}"
        self.fact = f"{path}: this file {has}, and this version of servobench reads format {number}"
        super().__init__(f"{self.fact}: {RUN_AGAIN}, or read it with the version that wrote it")


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """Base class of the contents of servobench's JSON files: a subclass has a dataclass field for
    each key of its file, and the constants FILE (the file's usual name) and KIND (a word for its
    content, such as "run").
    """

    FILE: ClassVar[str]
    """Usual name of the file."""
    KIND: ClassVar[str]
    """Word for the content of the file, such as "run"."""
    FORMAT: ClassVar[int] = 1
    """Format number; it increases by one when older versions cannot read the file any more."""

    def write(self, folder: Path, name: str | None = None) -> Path:
        """Write these contents as a JSON file into a folder, and return the file's path; an older
        file of this name is replaced.

        Args:
            folder: The folder; made if it does not exist.
            name: Name of the file; None: the constant FILE.

        Raises:
            OSError: The file cannot be written.
        """
        return atomic.write(folder, name or self.FILE, self.text())

    def text(self) -> str:
        """Return these contents as JSON."""
        return json_text(self.contents())

    def contents(self) -> dict[str, object]:
        """Return these contents by their keys, as JSON has them; the first two keys are "format"
        (the constant FORMAT) and "kind" (the constant KIND).
        """
        return {"format": self.FORMAT, "kind": self.KIND} | as_json(self)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the contents of a file of this kind; keys without a field of this class are
        ignored.

        Raises:
            OtherFormat: The file has another format number than FORMAT, or has none.
            Mistake: The file cannot be read, is not JSON, is of another kind, lacks a key, or has a
                value of the wrong type.
        """
        encoded = content(path)
        head = _parsed(path, encoded, dict[str, object])
        if head.get("format") is None:
            raise OtherFormat(path, None, cls.FORMAT)
        if head.get("kind") != cls.KIND:
            raise Mistake(
                f"{path}: this file describes a '{head.get('kind')}', but the file of a "
                f"'{cls.KIND}' is needed: name another file"
            )
        check_format(path, head["format"], cls.FORMAT)
        return _parsed(path, encoded, cls)


@dataclass(frozen=True, slots=True, kw_only=True)
class Made(Document):
    """Base class of the contents of JSON files that also name the command line that makes the file
    again ("" if it was made from Python), and the versions of packages, by name.
    """

    command: str
    """The command line that makes the file again, without --out and the number of workers; "" if
    the file was made from Python.
    """
    versions: dict[str, str]
    """Versions of the packages that decide the numbers, and the digest of our own source."""


def check_format(path: Path, found: object, number: int) -> None:
    """Check that a file has the format number that this version reads.

    Args:
        path: The file, for the message.
        found: Format number in the file, of any type; None if the file has none.
        number: Format number that this version reads.

    Raises:
        OtherFormat: `found` is not an integer, or is not `number`.
    """
    if type(found) is not int or found != number:
        raise OtherFormat(path, found, number)


def content(path: Path) -> bytes:
    """Return the bytes of a file of at most 1 GB.

    Raises:
        Mistake: The file cannot be read, is not a regular file, or is too large.
    """
    with as_mistake():
        return reading.content(path, "file", LARGEST)


def _parsed(path: Path, encoded: bytes, kind: type[T]) -> T:
    try:
        return TypeAdapter(kind).validate_json(encoded)
    except ValidationError as error:
        first = error.errors()[0]
        if first["type"] == "json_invalid":
            raise Mistake(f"{path}: this is not JSON; {HALF_WRITTEN}") from None
        where = ".".join(str(part) for part in first["loc"]) or "all of it"
        reason = first["msg"][0].lower() + first["msg"][1:]
        raise Mistake(
            f"{path}: the content of this file is wrong: {where}: {reason}; {RUN_AGAIN}"
        ) from None


def command_line(command: str, *words: str, **options: object) -> str:
    """Return a command line of servobench as text for a shell.

    Args:
        command: Subcommand, such as "run".
        words: Positional arguments.
        options: Options by name, with "_" in place of "-". True gives a flag; a list or tuple
            repeats the option for each of its values; None and False leave the option out.
    """
    given: list[str] = []
    for name, value in options.items():
        values = value if isinstance(value, list | tuple) else [value]
        for one in values:
            if one is not None and one is not False:
                given += [f"--{name.replace('_', '-')}", *([] if one is True else [str(one)])]
    if any(word.startswith("-") for word in words):  # else it would be read as an option
        return shlex.join(["servobench", command, *given, "--", *words])
    return shlex.join(["servobench", command, *words, *given])
