"""Reading of files that a user names: only regular files up to a size limit are read. Also a sorted
list of the names in a folder.
"""

import re
import stat
from pathlib import Path
from typing import BinaryIO

NUMBERS = re.compile("([0-9]+)")
KINDS = {
    stat.S_IFDIR: "it is a folder",
    stat.S_IFIFO: "it is a named pipe, not a file",
    stat.S_IFSOCK: "it is a socket, not a file",
    stat.S_IFCHR: "it is a device, not a file",
    stat.S_IFBLK: "it is a device, not a file",
}


def opened(path: Path, what: str) -> BinaryIO:
    """Open a regular file and return it, to be read as bytes; a pipe or a device is refused before
    it is opened.

    Args:
        path: Path of the file; links are followed.
        what: Kind of the file for error messages, such as "picture".

    Raises:
        ValueError: The file cannot be read, or is not a regular file.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            return path.open("rb")
        reason = KINDS.get(stat.S_IFMT(mode), "it is not a regular file")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no file can have this name"
    raise ValueError(f"{path}: cannot read this {what}: {reason}")


def content(path: Path, what: str, most: int) -> bytes:
    """Return the content of a regular file as bytes.

    Args:
        path: Path of the file; links are followed.
        what: Kind of the file for error messages, such as "picture".
        most: Largest size of the file [bytes].

    Raises:
        ValueError: The file cannot be read, is not a regular file, or is larger than `most`.
    """
    with opened(path, what) as file:
        try:
            data = file.read(most + 1) if path.stat().st_size <= most else None
        except OSError as error:
            raise ValueError(f"{path}: cannot read this {what}: {error.strerror}") from None
    if data is None or len(data) > most:
        raise ValueError(
            f"{path}: cannot read this {what}: it is too large; the limit is {most:,} bytes"
        )
    return data


def text(path: Path, what: str, most: int) -> str:
    """Return the text of a regular UTF-8 file, without a byte order mark.

    Args:
        path: Path of the file; links are followed.
        what: Kind of the file for error messages, such as "scenario".
        most: Largest size of the file [bytes].

    Raises:
        ValueError: The file cannot be read, is not a regular file, is larger than `most`, or is not
            UTF-8 text.
    """
    try:
        return content(path, what, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(
            f"{path}: cannot read this {what}: it is not UTF-8 text: save it as UTF-8, or give "
            "another file"
        ) from None


def names(folder: Path) -> list[Path]:
    """Return the paths of all files and folders directly in a folder, sorted by name; numbers in
    names count by their value, so that 9.png comes before 10.png.

    Raises:
        ValueError: There is no such folder, or it cannot be read.
    """
    try:
        return sorted(folder.iterdir(), key=_by_number)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no folder can have this name"
        raise ValueError(f"{folder}: cannot read this folder: {reason}") from None


def _by_number(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Return a sort key for a path, in which numbers in its name count by their value: 9.png comes
    before 10.png.
    """
    parts = NUMBERS.split(path.name)
    return [(int(p), "") if i % 2 else (0, p) for i, p in enumerate(parts)], path.name
