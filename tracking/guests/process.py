"""A program of another author, started and asked with time limits, and ended with all its children
when its connection is closed or our own process is killed.
"""

import fcntl
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NoReturn, TypeVar

from annotated_types import Ge, Le

Limit = Annotated[float, Ge(0.1), Le(3600.0)]
"""A time limit of a program's answer [s]."""
Answer = TypeVar("Answer")
LAST_LINES = 3
"""Number of lines of a program's stderr that an error quotes."""
LONGEST_LINE = 1 << 24
"""Most bytes of a program's output that are read at once: output without an end of line cannot fill
the memory."""
PIPE = 1 << 20
"""Size of the pipe to a program [bytes]: a picture of 640 x 480 pixels fits into it."""
GRACE = 0.5
"""Time between the request to quit and the kill of a program [s]."""
KEEPER = 'read -r _; kill -s KILL -- "-$1"; rm -rf -- "$2"'
"""Shell script that kills a program with its children and removes its folder, as soon as the script
reads a line or the end of its input, which ends also when our own process is killed."""


class GuestProcess:
    """A running program that answers what it is sent; it is ended with this object."""

    def __init__(
        self, name: str, command: str, environment: Mapping[str, str], goodbye: bytes = b""
    ) -> None:
        """Start a program.

        Args:
            name: What the program is, to begin messages, such as "TraX server".
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            environment: Variables that are added to our own environment.
            goodbye: Bytes that ask the program to end.

        Raises:
            ValueError: The command is empty or cannot be started.
        """
        if not command.strip():
            raise ValueError(
                f"the command of the {name} is empty: give one, such as 'python my_tracker.py'"
            )
        self.name = f"{name} '{command}'"
        self.folder = Path(tempfile.mkdtemp(prefix="guest-"))
        """A temporary folder, removed with the program."""
        self._log = self.folder / "stderr.txt"
        process = self._process = self._started(command, environment)
        _enlarge(process)
        script = ["sh", "-c", KEEPER, "sh", str(process.pid), str(self.folder)]
        keeper = subprocess.Popen(
            script, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self._close = weakref.finalize(self, _end, process, keeper, goodbye)

    def ask(
        self,
        parts: Sequence[bytes],
        answer_in: Callable[[bytes], Answer | None],
        limit: float,
        expected: str,
    ) -> Answer:
        """Send bytes, and return the program's answer.

        Args:
            parts: The bytes, in pieces.
            answer_in: Returns the answer in a line of output; None for a line that is none.
            limit: Longest wait [s].
            expected: What the answer should be, for messages.

        Raises:
            ValueError: The program has ended, or gave no answer within the limit.
        """
        # A program that hangs blocks our reading and writing: its kill ends both.
        began = time.monotonic()
        late = threading.Timer(limit, _kill, (self._process,))
        late.daemon = True
        late.start()
        answer = None
        try:
            self._send(parts)
            while answer is None and (line := self._line()):
                answer = answer_in(line)
        finally:
            late.cancel()
        if answer is None and time.monotonic() - began >= limit:
            self.fail(f"sent no {expected} within {limit:g} s")
        if answer is None:
            self.fail_ended(expected)
        return answer

    def end(self) -> None:
        """End the program, with all that it has started."""
        self._close()

    def fail_ended(self, expected: str) -> NoReturn:
        """Raise a ValueError that says that the program has ended instead of answering."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        code = self._process.poll()
        ended = "ended" if code is None else f"ended with code {code}"
        self.fail(f"{ended} instead of sending {expected}")

    def fail(self, fault: str) -> NoReturn:
        """End the program, and raise a ValueError with its name, a fault and the last lines of its
        stderr.
        """
        with self._log.open("rb") as log:
            lines = deque(filter(bytes.strip, log), LAST_LINES)
        self._close()
        words = " | ".join(line.decode("utf-8", "replace").strip()[:200] for line in lines)
        raise ValueError(f"{self.name} {fault}{words and f': {words}'}") from None

    def _started(self, command: str, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
        """Return the process of the program, whose stderr goes to a file.

        Raises:
            ValueError: The command cannot be started.
        """
        try:
            with self._log.open("wb") as log:
                return subprocess.Popen(
                    shlex.split(command),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    start_new_session=True,
                    env=os.environ | environment,
                )
        except (OSError, ValueError) as error:
            shutil.rmtree(self.folder)
            reason = getattr(error, "strerror", None) or error
            raise ValueError(f"{self.name} cannot be started: {reason}") from None

    def _send(self, parts: Sequence[bytes]) -> None:
        """Send bytes; a program that has ended is ignored, as it will not answer."""
        assert self._process.stdin is not None  # a pipe
        with suppress(OSError):
            self._process.stdin.writelines(parts)
            self._process.stdin.flush()

    def _line(self) -> bytes:
        """Return the next line of output, or its first `LONGEST_LINE` bytes; b"" at the end."""
        assert self._process.stdout is not None  # a pipe
        return self._process.stdout.readline(LONGEST_LINE)


def _enlarge(process: subprocess.Popen[bytes]) -> None:
    """Let a picture fit into the pipe to a program, if the system can: it is then sent at once, and
    not in pieces for which both processes wait in turn.
    """
    assert process.stdin is not None  # a pipe
    set_size = getattr(fcntl, "F_SETPIPE_SZ", None)  # Linux
    if set_size is not None:
        with suppress(OSError):  # beyond the user's limit
            fcntl.fcntl(process.stdin, set_size, PIPE)


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a program and its children."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _end(process: subprocess.Popen[bytes], keeper: subprocess.Popen[bytes], goodbye: bytes) -> None:
    """End a program and the processes that it has started, and remove its folder."""
    assert process.stdin is not None  # a pipe
    with suppress(OSError):
        process.stdin.write(goodbye)
        process.stdin.close()
    process.stdin = None  # `communicate` would flush it
    with suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    keeper.communicate(b"\n")
    process.communicate()
