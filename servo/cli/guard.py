"""The end of every command, whatever the output: a failure is one sentence and an exit code, and a
signal raises an exception, as Ctrl-C does, so that files are closed.
"""

import errno
import io
import logging
import os
import platform
import signal
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Timer
from typing import Any, NoReturn, TextIO, cast

from servo.mistake import MISPLACED, Mistake, Refused, printable, refusal
from sim.camera.gl import NoRenderer, check_environment
from sim.files.notices import Notice
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
WINDOWS = "this runs on Linux and macOS; on Windows use WSL (wsl --install)"


def guarded(command: Callable[[], Any]) -> None:
    """Run a command; a failure is one sentence on stderr and an exit code, never a traceback."""
    _set_environment()
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it prints messages about its caches
    _say_warnings_in_a_line()
    printer = Printer(sys.stdout)
    sys.stdout = cast(TextIO, printer)
    sys.stderr = cast(TextIO, Printer(sys.stderr))
    try:
        if platform.system() == "Windows":
            raise Mistake(WINDOWS)
        check_environment()
        command()
    except SystemExit as end:  # of every command that click has run
        printer.flush()
        if printer.refused is not None and not end.code:
            _end(f"standard output: {refusal(printer.refused)}", REFUSED)
        raise
    except (Mistake, NoRenderer, UnknownKind) as error:
        _end(str(error), MISTAKEN)
    except Refused as error:
        _end(str(error), REFUSED)
    except OSError as error:
        _end(refusal(error), MISTAKEN if error.errno in MISPLACED else REFUSED)
    except MemoryError:
        _end("there is not enough memory for this", REFUSED)


def _set_environment() -> None:
    """Set the environment variables that the libraries read; those of `ENVIRONMENT` that the user
    has set keep their values.
    """
    os.environ.update(ENVIRONMENT | os.environ)
    os.environ["MPLBACKEND"] = "agg"  # plots never open a window
    if sys.platform == "linux":
        # We never draw with GLFW there; MuJoCo would look for it by another Python process.
        os.environ.setdefault("PYGLFW_LIBRARY", os.devnull)


def _say_warnings_in_a_line() -> None:
    """Print our warnings without Python's place in the code."""
    of_python = warnings.formatwarning

    def formatted(message: Warning | str, category: type[Warning], *place: Any) -> str:
        if issubclass(category, Notice):
            return f"servobench: {message}\n"
        return of_python(message, category, *place)

    warnings.formatwarning = formatted


def _end(sentence: str, code: int) -> NoReturn:
    """Print a sentence on stderr and end the program with an exit code."""
    print(f"servobench: {sentence}", file=sys.stderr)
    sys.exit(code)


class Printer:
    """A stream that accepts text in any state: closed, full, or with a small character set.

    A command writes its files before it prints; an error in printing does not interrupt it.
    """

    def __init__(self, stream: TextIO | None) -> None:
        """Print to a standard stream; None: it was closed before the start."""
        self._stream = stream or io.StringIO()
        self.refused: OSError | None = None
        """Why not all could be printed; a reader that has seen enough (`| head`) is no reason."""
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    def write(self, text: str) -> int:
        """Write as much as can be written; the length of the text."""
        self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush what can be flushed."""
        self._try(lambda: self._stream.flush())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _try(self, act: Callable[[], Any]) -> None:
        try:
            act()
        except (OSError, ValueError) as error:
            if isinstance(error, OSError) and error.errno != errno.EPIPE:
                self.refused = error
            # Python flushes the stream again when it ends: its buffer goes to the null device.
            with suppress(OSError, ValueError), Path(os.devnull).open("w") as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())
            self._stream = io.StringIO()


ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)

STOPPED = "servobench: stopped; what was written is complete up to here."
SOON = 0.02
"""Time after which a signal is sent again whose exception was lost [s]."""


class StopSignal(KeyboardInterrupt):
    """A signal that ends the command."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


CTRL_C = 128 + signal.SIGINT


def exit_code(cause: KeyboardInterrupt) -> int:
    """The exit code that shells use for a program ended by a signal."""
    return 128 + (cause.number if isinstance(cause, StopSignal) else signal.SIGINT)


@contextmanager
def ending_signals() -> Generator[list[StopSignal]]:
    """Raise `StopSignal` at the first ending signal within the block, and ignore all later ones.

    A signal that is ignored from the start (nohup, a background job of a shell) stays ignored.

    Yields:
        What was raised: libraries of C make other exceptions of it.
    """
    raised = list[StopSignal]()

    def stop(number: int, *_: object) -> None:
        if not raised:
            raised.append(StopSignal(number))
            raise raised[0]

    def send_again(lost: "sys.UnraisableHookArgs") -> None:
        # Python drops an exception in a finalizer, and in a function that LLVM calls to compile.
        if not isinstance(lost.exc_value, StopSignal):
            hook(lost)
            return
        raised.clear()
        again = Timer(SOON, os.kill, (os.getpid(), lost.exc_value.number))
        again.daemon = True
        again.start()

    hook = sys.unraisablehook
    sys.unraisablehook = send_again
    ours = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in ENDING}
    before = {number: handler for number, handler in before.items() if handler in ours}
    for number in before:
        signal.signal(number, stop)
    try:
        yield raised
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def stop(cause: KeyboardInterrupt, more: str = "") -> NoReturn:
    """Print that Ctrl-C or another signal stopped the command, and end the program.

    It imports nothing: the signal may have interrupted an import, which then cannot be repeated.
    """
    print(printable(f"{STOPPED} {more}".rstrip()), file=sys.stderr)
    raise SystemExit(exit_code(cause))
