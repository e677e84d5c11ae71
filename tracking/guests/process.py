"""A program of another author: its settings, and the connection to it. The program is asked with
time limits. It is ended, with the other processes of its process group, when the connection is
closed or our own process is killed.
"""

import fcntl
import os
import select
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, TypeVar

from tracking.guests.guest import GuestSettings
from tracking.types import Trait

Answer = TypeVar("Answer")
LAST_LINES = 3
"""Number of lines of a program's stderr that an error quotes."""
MARKS = b" \t\r\n^~"
"""Characters of a line that an error does not quote: an empty line, or one that only marks a place
in the line of a traceback above it."""
LONGEST_LINE = 1 << 24
"""Most bytes of a program's output that are read at once: output without an end of line cannot fill
the memory."""
PIPE = 1 << 20
"""Size of the pipe to a program [bytes]: a picture of 640 x 480 pixels fits into it."""
LOOK = 0.1
"""Interval between checks whether a silent program has ended [s]."""
GRACE = 0.5
"""Time between the request to quit and the kill of a program [s]."""
KEEPER = 'read -r _; kill -s KILL -- "-$1"; rm -rf -- "$2"'
"""Shell script that kills a program's process group and removes the program's folder, as soon as
the script reads a line or the end of its input, which ends also when our own process is killed."""


@dataclass(frozen=True)
class ProcessSettings(GuestSettings):
    """Settings of a tracker in a process of its own: the command that starts it, which is run
    without a shell, and which a TOML file may not give.
    """

    traits = frozenset({Trait.FOREIGN})
    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The program with its arguments, such as "python my_tracker.py"; run without a shell."""


class GuestProcess:
    """A running program of another author, which gets bytes at its standard input and answers in
    lines. When this object is deleted, the program gets the bytes `goodbye` and is ended. `name`
    begins messages, `command` is run without a shell, and `environment` is added to our own.
    """

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
                f"the command of the {name} is empty: give it with --set or from Python (not in a "
                "TOML file), such as command = 'python my_program.py'"
            )
        self.name = f"{name} '{command}'"
        self.folder = Path(tempfile.mkdtemp(prefix="guest-"))
        """A temporary folder, removed with the program."""
        self._log = self.folder / "stderr.txt"
        process = self._process = self._started(command, environment)
        assert process.stdin is not None  # a pipe
        assert process.stdout is not None
        self._input = process.stdin.fileno()
        self._output = process.stdout.fileno()
        self._read = bytearray()
        """Output that was read and is not yet returned as a line."""
        self._is_asked = False
        os.set_blocking(self._input, False)
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
            answer_in: Function that returns the answer in a line of output; None if the line has no
                answer.
            limit: Longest wait [s].
            expected: What the answer should be, for messages.

        Raises:
            ValueError: The program has ended, gives no answer within the limit, or sent a second
                answer after the previous call. The program is then ended.
        """
        if not self._close.alive:
            raise ValueError(
                f"{self.name} was ended after an error, so it cannot follow any more pictures: "
                "start a new tracker"
            )
        until = time.monotonic() + limit
        if self._is_asked and self._has_waiting(answer_in):
            self.fail("sent an answer that it was not asked for: it must answer each message once")
        self._is_asked = True
        answer = None
        try:
            self._send(parts, until)
            while answer is None and (line := self._line(until)):
                answer = answer_in(line)
        except TimeoutError:
            self.fail(f"did not send {expected} within {limit:g} s")
        if answer is None:
            self.fail_ended(expected)
        return answer

    def _has_waiting(self, answer_in: Callable[[bytes], object]) -> bool:
        """Return True if the program has already sent an answer that nobody asked for."""
        while _is_ready(self._output, select.POLLIN, 0.0):
            data = os.read(self._output, PIPE)
            self._read += data
            if not data or len(self._read) > LONGEST_LINE:
                break
        *lines, rest = self._read.split(b"\n")
        self._read = rest
        return any(answer_in(bytes(line)) is not None for line in lines)

    def _send(self, parts: Sequence[bytes], until: float) -> None:
        """Send bytes; a program that has ended is ignored, as it will not answer.

        Raises:
            TimeoutError: The program has not read them by the time `until` of the monotonic clock
                [s].
        """
        for part in parts:
            rest = memoryview(part)
            while rest:
                if not _is_ready(self._input, select.POLLOUT, until - time.monotonic()):
                    raise TimeoutError
                try:
                    rest = rest[os.write(self._input, rest) :]
                except BlockingIOError:
                    continue
                except OSError:
                    return

    def _line(self, until: float) -> bytes:
        """Return the next line of output with its end, or its first `LONGEST_LINE` bytes; b"" at
        the end of the output.

        Raises:
            TimeoutError: No line is complete at a time of the monotonic clock [s].
        """
        searched = 0
        while (end := self._read.find(b"\n", searched)) < 0 and len(self._read) < LONGEST_LINE:
            searched = len(self._read)
            left = until - time.monotonic()
            if _is_ready(self._output, select.POLLIN, min(left, LOOK)):
                data = os.read(self._output, PIPE)
                self._read += data
            elif left <= 0:
                raise TimeoutError
            else:
                # A child in a session of its own may keep the output of an ended program open.
                data = None if self._process.poll() is None else b""
            if data == b"":
                break
        line = bytes(self._read[: end + 1 if end >= 0 else LONGEST_LINE])
        del self._read[: len(line)]
        return line

    def end(self) -> None:
        """End the program and the processes that it has started, except those in a process group
        of their own; a second call does nothing.
        """
        self._close()

    def fail_ended(self, expected: str) -> NoReturn:
        """End what is left of the program, and raise a ValueError that says how the program has
        ended, or that it closed its output, instead of sending its answer; `expected` names the
        answer, such as "a line of JSON".
        """
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        code = self._process.poll()
        ended = "closed its output" if code is None else _ended_with(code)
        self.fail(f"{ended} instead of sending {expected}")

    def fail(self, fault: str) -> NoReturn:
        """End the program, and raise a ValueError with its name, a fault such as "sent no answer",
        and the last lines of its stderr.
        """
        with self._log.open("rb") as log:
            lines = deque((line for line in log if line.strip(MARKS)), LAST_LINES)
        self._close()
        words = " | ".join(line.decode("utf-8", "replace").strip()[:200] for line in lines)
        raise ValueError(f"{self.name} failed: it {fault}{words and f': {words}'}") from None

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


def _ended_with(code: int) -> str:
    """Return how a program ended, by its exit code; a negative one is the signal that killed it."""
    if code >= 0:
        return f"ended with code {code}"
    with suppress(ValueError):
        return f"was killed by {signal.Signals(-code).name}"
    return f"was killed by signal {-code}"


def _is_ready(file: int, event: int, wait: float) -> bool:
    """Return True if a file descriptor can be read or written within a time [s]; at its end or in
    an error, too.
    """
    poll = select.poll()  # `select.select` takes no descriptor above 1023
    poll.register(file, event)
    return bool(poll.poll(max(wait, 0.0) * 1e3))


def _enlarge(process: subprocess.Popen[bytes]) -> None:
    """Let a picture fit into the pipe to a program, if the system can: it is then sent at once, and
    not in pieces for which both processes wait in turn.
    """
    assert process.stdin is not None  # a pipe
    set_size = getattr(fcntl, "F_SETPIPE_SZ", None)  # Linux
    if set_size is not None:
        with suppress(OSError):  # beyond the user's limit
            fcntl.fcntl(process.stdin, set_size, PIPE)


def _end(process: subprocess.Popen[bytes], keeper: subprocess.Popen[bytes], goodbye: bytes) -> None:
    """End a program and the other processes of its process group, and remove its folder."""
    assert process.stdin is not None  # a pipe
    assert process.stdout is not None  # a pipe
    with suppress(OSError):
        os.write(process.stdin.fileno(), goodbye)
    process.stdin.close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    keeper.communicate(b"\n")
    # Nothing waits for the end of the output: a child in a session of its own may keep it open.
    process.stdout.close()
    process.wait()
