"""The end of every command, whatever the output: a failure is one sentence and an exit code, and a
signal raises an exception, as Ctrl-C does, so that files are closed.
"""

from __future__ import annotations

import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

from servo.mistake import MISPLACED, Mistake, Refused, refusal
from sim.camera.gl import NoRenderer, check_environment
from sim.kinds import UnknownKind

MISTAKEN = 2
REFUSED = 1
"""Exit codes of a mistake that the user can correct, and of a failure of the machine."""
ENVIRONMENT = {
    "RUST_LOG": "off",  # Rerun
    "OPENCV_LOG_LEVEL": "SILENT",
    "OPENCV_FFMPEG_LOGLEVEL": "-8",
}
"""Settings that keep libraries from writing to the terminal: a command prints one sentence about a
failure. Values that the user has set stay."""


def guarded(command: Callable[[], Any]) -> None:
    """Run a command; a failure is one sentence on stderr and an exit code, never a traceback."""
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    os.environ["MPLBACKEND"] = "agg"  # plots never open a window
    if os.environ.get("COLUMNS", "").strip("0") == "":
        os.environ.pop("COLUMNS", None)  # rich cannot print with a width of 0
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it prints messages about its caches
    sys.stdout = Printer.of(sys.stdout)
    sys.stderr = Printer.of(sys.stderr)
    try:
        _check_folder()
        check_environment()
        command()
    except (Mistake, NoRenderer, UnknownKind) as error:
        _end(str(error), MISTAKEN)
    except Refused as error:
        _end(str(error), REFUSED)
    except OSError as error:
        _check_folder()
        _end(refusal(error), MISTAKEN if error.errno in MISPLACED else REFUSED)
    except MemoryError:
        _end("there is not enough memory for this", REFUSED)


def _check_folder() -> None:
    try:
        Path.cwd()
    except OSError:
        _end("the current folder is gone: go to one that exists", MISTAKEN)


def _end(sentence: str, code: int) -> None:
    print(f"servobench: {sentence}", file=sys.stderr)
    sys.exit(code)


class Printer:
    """A stream that accepts text in any state: closed, full, or with a small character set.

    A command writes its files before it prints; an error in printing does not make it fail.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._gone = False

    @staticmethod
    def of(stream: TextIO | None) -> Any:
        """The printer of a standard stream; None: the stream was closed before the start."""
        if isinstance(stream, Printer):
            return stream
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")
        return Printer(stream or io.StringIO())

    def write(self, text: str) -> int:
        """Write as much as can be written; the length of the text."""
        self._unless_gone(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush what can be flushed."""
        self._unless_gone(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _unless_gone(self, act: Callable[[], Any]) -> None:
        if self._gone:
            return
        try:
            act()
        except (OSError, ValueError):
            self._gone = True
            _send_nowhere(self._stream)


def _send_nowhere(stream: TextIO) -> None:
    """Redirect a stream to the null device: Python flushes its buffer again when it ends."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    except (OSError, ValueError):
        return


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
