"""Compilation of numeric loops by numba, with the machine code stored on disk if possible."""

# pyright: reportAttributeAccessIssue=false, reportPrivateUsage=false
# numba's settings are made at run time.
import functools
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar

import numba
from numba.core import config

Loop = TypeVar("Loop", bound=Callable[..., object])
NAME = "servobench-numba-{}"
SLOW = (
    "servobench: compiled loops cannot be stored ({}): compiling them takes 30 s in each run; "
    "set NUMBA_CACHE_DIR to a folder that can be written"
)


def compiled(
    error_model: Literal["python", "numpy"] = "python", fastmath: Collection[str] = ()
) -> Callable[[Loop], Loop]:
    """Return a decorator that compiles a numeric function with numba at its first call, and stores
    the machine code beside its source, or in the folder NUMBA_CACHE_DIR if that is set. Compiled
    functions run without Python's global lock.

    If neither the source's folder nor the user's cache can be written, as in a container, the
    machine code is stored in a temporary folder. If it cannot be stored at all, the function is
    compiled in each process. One line on stderr reports a function that cannot be stored, or a new
    temporary folder.

    Args:
        error_model: With "python" a division by zero raises an error, with "numpy" it gives inf or
            nan.
        fastmath: LLVM's optimisations of floats that are allowed: "contract" rounds a product and a
            sum once.
    """
    njit: Any = functools.partial(
        numba.njit, nogil=True, error_model=error_model, fastmath=set(fastmath)
    )

    def compile_(loop: Loop) -> Loop:
        if config.DISABLE_JIT:
            return loop
        with suppress(RuntimeError):  # numba found no folder to write to
            return _stored(njit(loop, cache=True))
        of_user = config.CACHE_DIR
        try:
            config.CACHE_DIR = str(_private_folder())  # numba reads it where a loop is defined
            return _stored(njit(loop, cache=True))
        except (OSError, RuntimeError) as error:
            _complain(str(error))
            return njit(loop)
        finally:
            config.CACHE_DIR = of_user  # loops of other packages are stored where they would be

    return compile_


def _stored(loop: Any) -> Any:
    """Change a function compiled by numba, in place, so that a failure to store its machine code,
    such as a full disk, is reported instead of raised; return the function.
    """
    save = loop._cache.save_overload

    def save_if_possible(*compilation: object) -> None:
        try:
            save(*compilation)
        except OSError as error:
            _complain(f"{loop._cache.cache_path}: {error.strerror}")

    loop._cache.save_overload = save_if_possible
    return loop


@functools.cache
def _private_folder() -> Path:
    """Return a temporary folder, to which only this user can write: its content is executed."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / NAME.format(user)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
        _complain(f"only in {folder}, which may not last")
    found = folder.lstat()
    others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not others:
        return folder
    return Path(tempfile.mkdtemp())


_complained: set[str] = set()


def _complain(reason: str) -> None:
    """Report once in this process that compiled loops cannot be stored, with the reason."""
    if not _complained:
        _complained.add(reason)
        sys.stderr.write(SLOW.format(reason) + "\n")
