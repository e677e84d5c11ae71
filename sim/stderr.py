"""Silence for libraries in C that write their own messages to the process's stderr."""

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress


@contextmanager
def silent_libraries() -> Generator[None]:
    """Send what is written to stderr meanwhile to nowhere: what matters is said in a sentence.

    It is the whole process's stderr: keep it around single calls.
    """
    try:
        stderr = os.dup(2)
    except OSError:  # stderr is closed: there is nothing to silence
        yield
        return
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 2)
        os.close(nothing)
        yield
    finally:
        with suppress(OSError):
            os.dup2(stderr, 2)
        os.close(stderr)
