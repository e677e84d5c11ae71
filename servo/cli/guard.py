"""The end of every command: a failure prints one sentence and gives an exit code, and a signal that
ends the command (SIGINT, SIGTERM, SIGHUP) raises an exception, so that files are closed.
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


def guarded(command: Callable[[], object]) -> None:
    """Run a command. If it fails, print one sentence on stderr and exit with a code: 2 for a
    mistake of the user (also a path that cannot be used, or Windows), 1 for a failure of the
    machine (also if stdout cannot be printed). From then on stdout and stderr are wrapped by
    `Printer`, and messages of libraries are hidden.

    Args:
        command: Function without arguments that does the command's work.

    Raises:
        SystemExit: The command failed, or exited itself.
        Exception: Any other exception of the command, which is a fault of servobench.
    """
    os.environ.update(ENVIRONMENT | os.environ)
    os.environ["MPLBACKEND"] = "agg"  # plots never open a window
    if sys.platform == "linux":
        # MuJoCo would look for GLFW, which is not used there, by another Python process.
        os.environ.setdefault("PYGLFW_LIBRARY", os.devnull)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it prints messages about its caches
    _say_warnings_in_a_line()
    printer = Printer(sys.stdout)
    sys.stdout = cast(TextIO, printer)
    sys.stderr = cast(TextIO, Printer(sys.stderr))
    try:
        if platform.system() == "Windows":
            raise Mistake("Windows is not supported: run servobench in WSL (wsl --install)")
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
        _end(
            "this machine has too little memory for the command: end other programs first",
            REFUSED,
        )


def _say_warnings_in_a_line() -> None:
    """Make Python print each warning of servobench (`Notice`) as one line, without the place in the
    code.
    """
    of_python = warnings.formatwarning

    def formatted(message: Warning | str, category: type[Warning], *place: Any) -> str:
        is_ours = issubclass(category, Notice)
        return f"servobench: {message}\n" if is_ours else of_python(message, category, *place)

    warnings.formatwarning = formatted


def _end(sentence: str, code: int) -> NoReturn:
    """Print a sentence on stderr and end the program with an exit code."""
    print(f"servobench: {sentence}", file=sys.stderr)
    sys.exit(code)


class Printer:
    """Wrapper of stdout or stderr that never raises on writing: it ignores a closed stream, keeps
    any other error, such as that of a full disk, in `refused`, and replaces characters that the
    encoding lacks.

    A command writes its files before it prints; an error in printing does not interrupt it.
    """

    def __init__(self, stream: TextIO | None) -> None:
        """Wrap a standard stream; None: the stream was closed before the program started."""
        self._stream = stream or io.StringIO()
        self.refused: OSError | None = None
        """The error of a text that was not printed; that of a closed pipe (`| head`) is ignored."""
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    def write(self, text: str) -> int:
        """Write as much of a text as the stream takes, and return the length of the whole text. An
        error is kept in `refused` in place of being raised.
        """
        self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream; keep its error in `refused` in place of raising it, except that of a
        closed pipe, which is ignored.
        """
        self._try(lambda: self._stream.flush())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _try(self, act: Callable[[], object]) -> None:
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
    """Exception raised where a signal (SIGINT, SIGTERM or SIGHUP) ends the command; `number` is the
    signal's number.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


CTRL_C = 128 + signal.SIGINT


def exit_code(cause: KeyboardInterrupt) -> int:
    """Return the exit code of a command that a signal stopped: 128 + number of the signal, as
    shells do. Any other KeyboardInterrupt than a `StopSignal` counts as SIGINT (130).
    """
    return 128 + (cause.number if isinstance(cause, StopSignal) else signal.SIGINT)


@contextmanager
def ending_signals() -> Generator[list[StopSignal]]:
    """Context manager: raise `StopSignal` at the first SIGINT, SIGTERM or SIGHUP within its block,
    and ignore all later ones. If Python drops the exception, as in a finalizer, the signal is sent
    again.

    A signal that is ignored from the start (nohup, a background job of a shell) stays ignored, and
    one that has a handler other than Python's own keeps this handler.

    Yields:
        A list to which the raised `StopSignal` is added, since a C library may replace it by its
        own exception.
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
    before = {number: handler for number in ENDING if (handler := signal.getsignal(number)) in ours}
    for number in before:
        signal.signal(number, stop)
    try:
        yield raised
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def stop(cause: KeyboardInterrupt, more: str = "") -> NoReturn:
    """Print on stderr that the command was stopped, followed by a sentence, and exit with the
    signal's code.

    This function imports nothing: the signal may have interrupted an import, which then cannot be
    repeated.

    Args:
        cause: The exception that Ctrl-C or another signal raised.
        more: The sentence, such as how to continue.

    Raises:
        SystemExit: Always; its code is 128 + the signal's number.
    """
    print(printable(f"{STOPPED} {more}".rstrip()), file=sys.stderr)
    raise SystemExit(exit_code(cause))
