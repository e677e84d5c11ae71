"""Writing of files so that each is complete or absent, and never through a link.

A file is written under another name, flushed to the disk, and renamed over an older one; only
`new_file` opens a file under its own name. Because the folder may come from another person, a link
that has the file's name is replaced (or refused, if it leads into /proc), and a link in place of a
folder below the root is refused.
"""

import errno
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from sim.files.reading import KINDS

ASIDE = ".{}.part"
"""Name of an unfinished file; {} is its final name."""
NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)


def write(root: Path, name: str, content: bytes | str) -> Path:
    """Write a file, replacing an older one.

    Args:
        root: The folder to write to; made if it does not exist.
        name: Name of the file in it, such as "report.json" or "results/kams/a-0.json".
        content: Bytes, or a text that is written as UTF-8.

    Returns:
        The path of the file.

    Raises:
        OSError: The file cannot be written, or a folder in `name` is a link.
    """
    with writing(root, name) as file:
        file.write(content.encode() if isinstance(content, str) else content)
    return root / name


@contextmanager
def writing(root: Path, name: str) -> Generator[BinaryIO]:
    """Context manager: open a binary file for the block, under a temporary name. When the block
    ends without an exception, the file gets its name and replaces an older one; otherwise it is
    removed, and an older one stays.

    Args:
        root: The folder to write to; made if it does not exist.
        name: Name of the file in it, such as "report.json" or "results/kams/a-0.json".

    Raises:
        OSError: The file cannot be written, or a folder in `name` is a link.
    """
    path = folder(root, str(PurePosixPath(name).parent)) / PurePosixPath(name).name
    aside = path.with_name(ASIDE.format(path.name))
    _check_replaceable(path)
    try:
        with naming(path), new_file(aside) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def _check_replaceable(path: Path) -> None:
    """Check that a path is free, or that of a file or link, which can be replaced.

    Raises:
        OSError: The path is a device, a pipe, a socket, a folder, or a link into /proc, such as
            /dev/stdout.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISLNK(mode) and path.readlink().is_relative_to("/proc"):
        mode = stat.S_IFCHR
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        raise OSError(errno.EEXIST, KINDS.get(stat.S_IFMT(mode), "it is not a file"), path)


@contextmanager
def naming(path: Path) -> Generator[None]:
    """Context manager: to an OSError of the block that names no file, add `path` as its file name,
    so that its message shows it. The error is raised again.
    """
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def new_file(path: Path) -> BinaryIO:
    """Open a new binary file for writing; an older file or link of this name is removed first.

    Raises:
        OSError: The file cannot be made, or the path is a folder.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, NEW, 0o666), "wb")


def folder(root: Path, name: str) -> Path:
    """Make a folder below a root, if it does not exist, and return its path.

    Args:
        root: The root; made if it does not exist.
        name: Path from the root, such as "results/kams"; none of its folders may be a link.

    Raises:
        OSError: A folder cannot be made, or is a link.
    """
    root.mkdir(parents=True, exist_ok=True)
    path = root
    for part in PurePosixPath(name).parts:
        path = path / part
        if path.is_symlink():
            why = "this folder is a link, and nothing is written through it: replace it by a folder"
            raise OSError(errno.ELOOP, why, path)
        path.mkdir(exist_ok=True)
    return path
