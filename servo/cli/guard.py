"""The end of every command: one sentence and an exit code for any failure, whatever the output."""

from __future__ import annotations

import io
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from servo.mistake import MISPLACED, Mistake, Refused, refusal
from sim.gl import NoRenderer, check_environment
from sim.kinds import UnknownKind

MISTAKEN, REFUSED = 2, 1
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
    sys.stdout, sys.stderr = Printer.of(sys.stdout), Printer.of(sys.stderr)
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
        self._stream, self._gone = stream, False

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
