"""Signals that end a command; each raises an exception, as Ctrl-C does, and files are closed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


class Stopped(KeyboardInterrupt):
    """A signal that ends the command."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def exit_code(cause: KeyboardInterrupt) -> int:
    """The exit code that shells use for a program ended by a signal."""
    return 128 + (cause.number if isinstance(cause, Stopped) else signal.SIGINT)


@contextmanager
def ending_signals() -> Generator[None]:
    """Raise `Stopped` at the first ending signal within the block, and ignore all later ones.

    A signal that is ignored from the start (nohup, a background job of a shell) stays ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    stopped = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal stopped
        del frame
        if not stopped:
            stopped = True
            raise Stopped(number)

    ours = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in ENDING}
    before = {number: handler for number, handler in before.items() if handler in ours}
    for number in before:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
