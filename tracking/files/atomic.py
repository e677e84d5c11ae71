"""Files that are written whole or not at all; nothing is written through a link.

A file is written aside, flushed to the disk, and renamed over what was there. The folder may come
from somebody else: a link in it is replaced where it is a file, and refused where it is a folder.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from sim.files.reading import KINDS

ASIDE = ".{}.part"
"""Name of a file while it is written."""
NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)


def write(root: Path, name: str, content: bytes | str) -> Path:
    """Write a file as a whole, over an older one.

    Args:
        root: The folder that is written to; made if need be.
        name: Of the file in it, such as "report.json" or "results/kams/a-0.json".
        content: A text is written as UTF-8.

    Returns:
        Its path.

    Raises:
        OSError: The disk refuses, or a folder on the way is a link.
    """
    with writing(root, name) as file:
        file.write(content.encode() if isinstance(content, str) else content)
    return root / name


@contextmanager
def writing(root: Path, name: str) -> Generator[BinaryIO]:
    """A binary file that is in its place when the block ends; after an exception it is not.

    Args and errors are those of `write`.
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
    _flush_folder(path.parent)


def _check_replaceable(path: Path) -> None:
    """Refuse to put a file in the place of a device, a pipe or a folder.

    Raises:
        OSError: There is one.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        raise OSError(errno.EEXIST, KINDS.get(stat.S_IFMT(mode), "it is not a file"), path)


@contextmanager
def naming(path: Path) -> Generator[None]:
    """Let the operating system's errors in the block say which file they are about."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def new_file(path: Path) -> BinaryIO:
    """A file opened for writing in the place of an older one or of a link, which is not followed.

    Raises:
        OSError: The disk refuses.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, NEW, 0o666), "wb")


def folder(root: Path, name: str) -> Path:
    """A folder below a root, made with all between; none of them may be a link.

    Raises:
        OSError: The disk refuses, or a folder on the way is a link.
    """
    root.mkdir(parents=True, exist_ok=True)
    path = root
    for part in PurePosixPath(name).parts:
        path = path / part
        if path.is_symlink():
            raise OSError(errno.ELOOP, "this is a link, and nothing is written through it", path)
        path.mkdir(exist_ok=True)
    return path


def _flush_folder(path: Path) -> None:
    """Make a rename survive a power failure, where the system can."""
    try:
        opened = os.open(path, os.O_RDONLY)
    except OSError:  # a system without folders that can be opened, or one that may only be written
        return
    try:
        os.fsync(opened)
    except OSError:
        pass
    finally:
        os.close(opened)
