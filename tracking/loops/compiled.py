"""Compilation of loops: once on each machine, with the result stored on disk if possible."""

# pyright: reportAttributeAccessIssue=false
# numba's settings are made at run time.
import os
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar

import numba
from numba.core import config

Loop = TypeVar("Loop", bound=Callable[..., object])
NAME = "servobench-numba-{}"


def compiled(error_model: Literal["python", "numpy"] = "python") -> Callable[[Loop], Loop]:
    """Compile a loop at its first call, and store the result beside its source.

    If neither the source's folder nor the user's cache can be written, as in a container, the
    result is stored in the temporary folder.

    Args:
        error_model: With "python" a division by zero raises an error, with "numpy" it gives inf or
            nan.
    """

    def compile_(loop: Loop) -> Loop:
        njit: Any = numba.njit(cache=True, nogil=True, error_model=error_model)
        try:
            return njit(loop)
        except RuntimeError:  # numba found no folder to write to
            config.CACHE_DIR = str(_private_folder())
            return njit(loop)

    return compile_


def _private_folder() -> Path:
    """Return a temporary folder that only this user can write to: its content is executed."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / NAME.format(user)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not others:
        return folder
    return Path(tempfile.mkdtemp())
