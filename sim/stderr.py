"""Suppression of messages that C libraries write to the process's stderr."""

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress


@contextmanager
def silent_libraries() -> Generator[None]:
    """Context manager that suppresses everything that is written to the process's stderr, also by C
    libraries. It acts on all threads, so the `with` block should be short.
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
