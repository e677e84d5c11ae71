"""The end of every command, whatever the output: a failure is one sentence and an exit code, and a
signal raises an exception, as Ctrl-C does, so that files are closed.
"""

import errno
import importlib
import io
import logging
import os
import platform
import signal
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from importlib import metadata
from math import inf
from pathlib import Path
from threading import Timer
from time import monotonic
from types import FrameType
from typing import Any, TextIO, cast

from servo.mistake import MISPLACED, Mistake, Refused, refusal
from sim.camera.gl import NoRenderer, check_environment
from sim.files.notices import Notice
from sim.kinds import UnknownKind

MISTAKEN = 2
REFUSED = 1
"""Exit codes of a mistake that the user can correct, and of a failure of the machine."""
NEEDED = 1_800_000_000
NEEDED_BY_RERUN = 3_600_000_000
"""Address space that a run needs [bytes] without and with a recording, mostly for its libraries: on
two cores all runs had enough; with 0.2 GB less some ended in OpenBLAS or in Rerun's threads."""
ENVIRONMENT = {
    "RUST_LOG": "off",  # Rerun
    "OPENCV_LOG_LEVEL": "SILENT",
    "OPENCV_FFMPEG_LOGLEVEL": "-8",
}
"""Settings that keep libraries from writing to the terminal: a command prints one sentence about a
failure. Values that the user has set stay."""
STORE = "NUMBA_CACHE_DIR"
"""The one setting of Numba that README names; it can be any text."""
OF_NUMBA = Path(".numba_config.yaml")
"""Numba reads its settings in this file of the current folder, too."""
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
        _check_numba()
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
    except (MemoryError, ImportError) as error:
        # A library that cannot be loaded within a limit of memory needs more of it.
        if isinstance(error, ImportError) and not _memory_limit():
            raise
        _end("there is not enough memory for this", REFUSED)


def _set_environment() -> None:
    """Set what libraries read from the environment, and remove what they cannot use."""
    os.environ.update(ENVIRONMENT | os.environ)
    os.environ["MPLBACKEND"] = "agg"  # plots never open a window
    if os.environ.get("COLUMNS", "").strip("0") == "":
        os.environ.pop("COLUMNS", None)  # rich cannot print with a width of 0
    if os.environ.get("NO_COLOR"):
        os.environ.pop("FORCE_COLOR", None)  # rich would still print bold words


def _check_numba() -> None:
    """Refuse settings of Numba that it cannot read: importing it would end in a traceback.

    Raises:
        Mistake: There are some.
    """
    given = [f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_") and k != STORE]
    if not given and not OF_NUMBA.exists():
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            importlib.import_module("numba")
        except (MemoryError, ImportError):
            raise
        except Exception as error:
            reason = next(iter(str(error).splitlines()), type(error).__name__)
            settings = ", ".join(given or [str(OF_NUMBA)])
            raise Mistake(f"Numba cannot begin with {settings}: {reason}") from None


def _say_warnings_in_a_line() -> None:
    """Print our warnings without Python's place in the code."""
    of_python = warnings.formatwarning

    def formatted(message: Warning | str, category: type[Warning], *place: Any) -> str:
        if issubclass(category, Notice):
            return f"servobench: {message}\n"
        return of_python(message, category, *place)

    warnings.formatwarning = formatted


def _end(sentence: str, code: int) -> None:
    print(f"servobench: {sentence}{_memory_limit()}", file=sys.stderr)
    sys.exit(code)


def check_machine(*, rerun: bool = False) -> None:
    """Refuse what libraries would end in, in their own words, before they are imported.

    Raises:
        MemoryError: Libraries of C and Rust would get too little memory, and end the process.
        Mistake: The entry points of some package cannot be read: Numba, Dask, pydantic and Sphinx
            read those of all packages.
    """
    for package in metadata.distributions():
        try:
            len(package.entry_points)
        except (TypeError, ValueError):
            raise Mistake(
                f"the package {package.name} is damaged: its entry_points.txt cannot be read; "
                "install it again, or remove it"
            ) from None
    if _address_space() < (NEEDED_BY_RERUN if rerun else NEEDED):
        raise MemoryError


def _memory_limit() -> str:
    """Return the limit of this process's memory, for any failure where it is below a run's need:
    libraries that get no memory name other causes, such as a driver or a file.
    """
    limit = _address_space()
    if limit >= NEEDED_BY_RERUN:
        return ""
    return (
        f" (this process may have {limit / 1e9:.1f} GB of memory, by ulimit -v; a run needs "
        f"{NEEDED_BY_RERUN / 1e9:.1f} GB, or {NEEDED / 1e9:.1f} GB without a Rerun recording)"
    )


def _address_space() -> float:
    """Return the largest size of this process [bytes]."""
    import resource  # Windows has none

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return inf if limit == resource.RLIM_INFINITY else limit


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


IMPORTER = "<frozen importlib._bootstrap>"
"""File of Python's own code that imports modules."""
SOON = 0.02
"""Time until a signal that comes at the wrong moment is tried again [s]."""
LONGEST_IMPORT = 5.0
"""From then on the import is stopped as well: it may hang [s]."""


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
    latest = inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal latest
        latest = min(latest, monotonic() + LONGEST_IMPORT)
        if _imports(frame) and monotonic() < latest:
            _signal_soon(number)
        elif not raised:
            raised.append(StopSignal(number))
            raise raised[0]

    def try_again(lost: "sys.UnraisableHookArgs") -> None:
        # It was raised where Python has nobody to give it to: in a function that LLVM calls while
        # it compiles, in a finalizer.
        if isinstance(lost.exc_value, StopSignal):
            raised.clear()
            _signal_soon(lost.exc_value.number)
        else:
            hook(lost)

    hook = sys.unraisablehook
    sys.unraisablehook = try_again
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


def _signal_soon(number: int) -> None:
    """Send this process a signal again."""
    again = Timer(SOON, os.kill, (os.getpid(), number))
    again.daemon = True
    again.start()


def _imports(frame: FrameType | None) -> bool:
    """Return whether a module is being imported: those of C, such as NumPy's, take an exception in
    the middle of it for a fault of their own.
    """
    while frame is not None and frame.f_code.co_filename != IMPORTER:
        frame = frame.f_back
    return frame is not None
