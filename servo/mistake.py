"""Errors as one sentence for the user: mistakes in the input (`Mistake`), and failures of the
machine (`Refused`); with functions that check input and that write such sentences.
"""

import difflib
import errno
import traceback
from collections.abc import Collection, Generator, Iterable
from contextlib import contextmanager
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE)
"""Error numbers (`errno`) of a machine whose disk is full or fails, or that has too many files
open."""
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
"""Error numbers (`errno`) that say that the path which the user chose is wrong: it does not exist,
is of another kind, or may not be used."""
LONGEST = 2000
"""Largest length of a sentence [characters]; of a longer one the middle is left out."""


class Mistake(ValueError):
    """Error of a mistake in the user's input, as one sentence: what is wrong, where, and what would
    be right.

    Line breaks and control characters in the sentence are replaced by their escape sequences; of a
    sentence with over 2000 characters the middle is left out.
    """

    def __init__(self, sentence: object) -> None:
        super().__init__(one_line(str(sentence)))  # a vector environment gives it a Mistake

    def _render_traceback_(self) -> list[str]:
        """Return the lines that a notebook shows: the sentence, and the traceback of its cause if
        there is one.
        """
        raised = [] if self.__cause__ is None else traceback.format_exception(self.__cause__)
        return [*"".join(raised).splitlines(), f"{type(self).__name__}: {self}"]


class Refused(RuntimeError):
    """Error of a failure of the machine, such as a full disk, as one sentence; a command that it
    ends exits with 1.

    Line breaks and control characters in the sentence are replaced by their escape sequences; of a
    sentence with over 2000 characters the middle is left out.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(one_line(sentence))


def unwritable(place: object, error: OSError, what: str = "to this folder") -> Mistake | Refused:
    """Return the exception, to be raised, that says why a file cannot be written: `Refused` if the
    disk is full or fails or too many files are open, else `Mistake`, which advises another place.

    Args:
        place: File or folder that was to be written.
        error: The error of the operating system.
        what: Words after "cannot write" in the sentence.
    """
    sentence = f"{place}: cannot write {what}: {error.strerror}"
    if error.errno in FULL:
        return Refused(f"{sentence}; remove the cause, and run again")
    return Mistake(f"{sentence}; choose another place")


@contextmanager
def writing(place: object, what: str = "to this folder") -> Generator[None]:
    """Context manager that turns an OSError in its block, which writes files, into a `Mistake` or
    `Refused` with one sentence.

    Args:
        place: File or folder that is written.
        what: Words after "cannot write" in the sentence.

    Raises:
        Refused: The disk is full or fails, or too many files are open.
        Mistake: There is any other error of the operating system, such as a missing permission.
    """
    try:
        yield
    except OSError as error:
        raise unwritable(place, error, what) from None


@contextmanager
def as_mistake() -> Generator[None]:
    """Context manager that turns a ValueError in its block into a `Mistake` with the same
    sentence.
    """
    try:
        yield
    except Mistake:
        raise
    except ValueError as error:
        raise Mistake(str(error)) from None


def check_suffix(path: Path, *suffixes: str) -> None:
    """Check that the name of a file to write ends in one of the suffixes, in small or capital
    letters, so that a file of another type is not replaced.

    Args:
        path: The file.
        suffixes: Allowed endings in small letters and with the dot, such as ".png".

    Raises:
        Mistake: The name has another ending.
    """
    if path.suffix.lower() not in suffixes:
        raise Mistake(f"{path}: the name of this file should end in {' or '.join(suffixes)}")


def check_rules(*rules: tuple[bool, str]) -> None:
    """Check rules that an input has to keep, in order.

    Args:
        *rules: Pairs (condition, sentence): the condition is True if the rule is broken, and the
            sentence says so.

    Raises:
        Mistake: A rule is broken; the sentence is that of the first one.
    """
    for is_broken, sentence in rules:
        if is_broken:
            raise Mistake(sentence)


def refusal(error: OSError) -> str:
    """Return a sentence for an error of the operating system: "FILE: REASON", or the reason alone
    if the error names no file.
    """
    why = error.strerror or str(error)
    return why if error.filename is None else f"{error.filename}: {why}"


def printable(text: str, keep: str = "\n") -> str:
    """Return a text with escape sequences in place of control characters and all others that are
    not printable, so that it is safe to print on a terminal.

    Args:
        text: The text.
        keep: Characters that stay, by default line breaks.
    """
    return "".join(c if c.isprintable() or c in keep else ascii(c)[1:-1] for c in text)


def one_line(sentence: str) -> str:
    """Return a sentence with escape sequences in place of line breaks and control characters; of a
    sentence with over 2000 characters the middle is left out.
    """
    line = printable(sentence, keep="")
    if len(line) > LONGEST:
        line = f"{line[: LONGEST // 2]} [...] {line[-LONGEST // 2 :]}"
    return line


def unknown(key: str, known: Iterable[str], what: str = "key") -> str:
    """Return the sentence for a name that does not exist, with the most similar known name, or with
    all known names if none is similar. If there are no known names, it says that this kind of
    component has no settings.

    Args:
        key: The name that was given.
        known: All names that exist.
        what: The noun for such a name, such as "key" or "feature".
    """
    names = list(known)
    if not names:
        return f"there is no {what} '{key}'; this kind has no settings"
    near = difflib.get_close_matches(key, names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(names)}"
    return f"there is no {what} '{key}'; {hint}"


def check_known(
    names: Iterable[str], known: Collection[str], place: str, what: str = "key"
) -> None:
    """Check that all names that a user gave are known.

    Args:
        names: The names that the user gave.
        known: All names that exist.
        place: The file or option with the given names; it begins the sentence.
        what: The noun for such a name, such as "claim".

    Raises:
        Mistake: A name is not known; the sentence has the most similar known name, or all of them.
    """
    for name in names:
        if name not in known:
            raise Mistake(f"{place}: {unknown(name, known, what)}")
