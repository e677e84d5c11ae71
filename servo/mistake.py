"""What a person got wrong, and what a machine refused; quick to import, for those who catch it."""

import difflib
import errno
import traceback
from collections.abc import Collection, Generator, Iterable
from contextlib import contextmanager
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE)
"""Errors of a machine that has no more room, or no more open files."""
MISPLACED = (
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
)
"""Errors of a path that the user chose: it cannot be what it should be."""
LONGEST = 2000
"""A sentence that quotes more than can be read keeps its two ends [characters]."""


class Mistake(ValueError):
    """Something the user got wrong, in one sentence: what, where, and what would be right.

    What it quotes may be anything, so line breaks and control characters are written out.
    """

    def __init__(self, sentence: object) -> None:
        super().__init__(one_line(str(sentence)))  # a vector environment gives it a Mistake

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the sentence, and where it has a cause, the cause's traceback."""
        raised = [] if self.__cause__ is None else traceback.format_exception(self.__cause__)
        return [*"".join(raised).splitlines(), f"{type(self).__name__}: {self}"]


class Refused(RuntimeError):
    """Something the machine did not do, such as writing to a full disk, in one sentence."""

    def __init__(self, sentence: str) -> None:
        super().__init__(one_line(sentence))


def unwritable(place: object, error: OSError, what: str = "to this folder") -> Mistake | Refused:
    """Why something cannot be written: its place is wrong, or the machine is full."""
    sentence = f"{place}: cannot write {what}: {error.strerror}"
    return Refused(sentence) if error.errno in FULL else Mistake(sentence)


@contextmanager
def writing(place: object, what: str = "to this folder") -> Generator[None]:
    """Turn an error of the disk in the block into a sentence; `what` is written at the place.

    Raises:
        Mistake: The place is wrong.
        Refused: The machine is full.
    """
    try:
        yield
    except OSError as error:
        raise unwritable(place, error, what) from None


@contextmanager
def as_mistake() -> Generator[None]:
    """Make a ValueError in the block the user's mistake, with the same sentence."""
    try:
        yield
    except Mistake:
        raise
    except ValueError as error:
        raise Mistake(str(error)) from None


def check_suffix(path: Path, *suffixes: str) -> None:
    """Refuse a file to write that by its name is of another kind, and may be the user's own.

    Raises:
        Mistake: It is.
    """
    if path.suffix.lower() not in suffixes:
        raise Mistake(f"{path}: the name of this file should end in {' or '.join(suffixes)}")


def refusal(error: OSError) -> str:
    """An error of the operating system in one sentence: which file, and why."""
    why = error.strerror or str(error)
    return why if error.filename is None else f"{error.filename}: {why}"


def printable(text: str, keep: str = "\n") -> str:
    """Return a text that changes nothing on a terminal: control characters are written out."""
    return "".join(c if c.isprintable() or c in keep else ascii(c)[1:-1] for c in text)


def one_line(sentence: str) -> str:
    """Return a sentence with its line breaks and control characters written out."""
    line = printable(sentence, keep="")
    if len(line) > LONGEST:
        line = f"{line[: LONGEST // 2]} [...] {line[-LONGEST // 2 :]}"
    return line


def unknown(key: str, known: Iterable[str], what: str = "key") -> str:
    """The sentence for a key, or something else, that does not exist."""
    names = list(known)
    if not names:
        return f"there is no {what} '{key}'; this kind has no settings"
    near = difflib.get_close_matches(key, names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(names)}"
    return f"there is no {what} '{key}'; {hint}"


def check_known(
    names: Iterable[str], known: Collection[str], place: str, what: str = "key"
) -> None:
    """Refuse names that do not exist.

    Args:
        names: Those that are given.
        known: All that exist.
        place: Where they are given, such as a file or an option.
        what: Their kind, such as "claim".

    Raises:
        Mistake: The first that does not exist, with the one that may be meant.
    """
    for name in names:
        if name not in known:
            raise Mistake(f"{place}: {unknown(name, known, what)}")
