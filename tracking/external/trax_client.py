"""A tracker in a process of its own that speaks the TraX protocol: starts, asks and ends it."""

import os
import queue
import shlex
import signal
import subprocess
import tempfile
import threading
import weakref
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

from sim.types import Array, Image
from tracking.external.trax_messages import (
    Message,
    message_in,
    picture_text,
    region_in,
    region_text,
)

TOGETHER = {"1", "2", "3"}
"""Versions in which region and first picture come in one message; later, they come in two."""
PICTURES = {"path", "memory", "buffer", "data"}
LONGEST_LINE = 1_000_000
"""A longer line of a server is no message [bytes]."""
LAST_WORDS = 3
"""Lines of a server's stderr that a message quotes."""
GRACE = 0.5
"""How long a server may take to end by itself [s]."""
WAITING = 100
"""Most messages of a server that wait to be read."""


class TraxClient:
    """One server. It ends with this object, or with Python."""

    def __init__(self, command: str, timeout: float) -> None:
        """Start a server and wait for its hello.

        Args:
            command: The program with its arguments, as in a shell, but run without one.
            timeout: Longest wait for an answer [s].

        Raises:
            ValueError: It cannot be started, says no hello, or takes neither our regions nor our
                pictures.
        """
        self._command = command
        self._timeout = timeout
        self._process = self._started()
        self._folder = tempfile.TemporaryDirectory(prefix="trax-")
        self._answers: queue.Queue[Message | None] = queue.Queue(WAITING)
        self._questions: queue.Queue[str] = queue.Queue()
        self._words: deque[str] = deque(maxlen=LAST_WORDS)
        self.close = weakref.finalize(self, _end, self._process, self._questions, self._folder)
        """Ask the server to end, and end it."""
        self._threads = [
            _thread(_write, self._process.stdin, self._questions),
            _thread(_read, self._process.stdout, self._answers),
            _thread(_note, self._process.stderr, self._words),
        ]
        self._count, hello = 0, self._answer("hello").named

        def listed(key: str, default: str) -> list[str]:
            return [word for word in (hello.get(f"trax.{key}") or default).split(";") if word]

        self._separate = hello.get("trax.version", "1") not in TOGETHER
        self._pictures = listed("image", "path")
        regions = listed("region", "rectangle")
        self.polygons = "polygon" in regions
        """Whether the server takes four corners; else it takes boxes."""
        if not {"rectangle", "polygon"} & set(regions):
            raise self._fault(f"takes {', '.join(regions)} as region; we have rectangle, polygon")
        if not PICTURES & set(self._pictures):
            raise self._fault(
                f"takes {', '.join(self._pictures)} as picture; we have "
                f"{', '.join(sorted(PICTURES))}"
            )
        if (channels := listed("channels", "color")) != ["color"]:
            raise self._fault(f"needs the channels {', '.join(channels)}; we have color")

    def initialize(self, image: Image, region: Array) -> None:
        """Show the first picture with the target's box (4,) or corners (4, 2) [px].

        Raises:
            ValueError: As for `frame`.
        """
        picture = self._picture(image)
        target = region_text(region)
        if self._separate:
            self._ask(Message("initialize", (target,)), Message("frame", (picture,)))
        else:
            self._ask(Message("initialize", (picture, target)))

    def frame(self, image: Image) -> tuple[Array | None, dict[str, str]]:
        """The target's region in the next picture, and what the server says about it.

        Returns:
            A box (4,) or a polygon (n, 2) [px], None where the target is not seen; named values.

        Raises:
            ValueError: The server has ended, is silent for too long, or answers something else.
        """
        answer = self._ask(Message("frame", (self._picture(image),)))
        try:
            return region_in(*answer.arguments), dict(answer.named)
        except (TypeError, ValueError) as error:
            reason = error if isinstance(error, ValueError) else "no region"
            said = answer.line().strip()[:80]
            raise self._fault(f"answered {said}, which is {reason}") from None

    def _picture(self, image: Image) -> str:
        """A picture as the server takes it; a file of its own each, of which the last two stay."""
        folder = Path(self._folder.name)
        self._count = self._count + 1
        (folder / f"{self._count - 2:08}.png").unlink(missing_ok=True)
        return picture_text(image, self._pictures, folder / f"{self._count:08}.png")

    def _ask(self, *messages: Message) -> Message:
        if not self._answers.empty():
            early = self._answers.get()
            if early is not None:
                raise self._fault(f"said {early.type} unasked")
            self._answers.put(None)  # it has ended, as `_answer` says
        for message in messages:
            self._questions.put(message.line())
        return self._answer("state")

    def _answer(self, wanted: str) -> Message:
        try:
            answer = self._answers.get(timeout=self._timeout)
        except queue.Empty:
            raise self._fault(f"said no {wanted} within {self._timeout:g} s") from None
        if answer is None or answer.type == "quit":
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            code = self._process.poll()
            ended = "ended" if code is None else f"ended with code {code}"
            raise self._fault(f"{ended} where its {wanted} is expected")
        if answer.type != wanted:
            raise self._fault(f"said {answer.type} where its {wanted} is expected")
        return answer

    def _fault(self, what: str) -> ValueError:
        """What the server did wrong, with its last words on stderr; it is ended."""
        self.close()
        self._threads[-1].join(GRACE)
        words = " | ".join(self._words)
        return ValueError(f"TraX server '{self._command}' {what}" + f": {words}" * bool(words))

    def _started(self) -> subprocess.Popen[bytes]:
        pipe = subprocess.PIPE
        try:
            if words := shlex.split(self._command):
                return subprocess.Popen(
                    words,
                    stdin=pipe,
                    stdout=pipe,
                    stderr=pipe,
                    start_new_session=True,
                    env=os.environ | {"TRAX": "1"},
                )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            text = f"TraX server '{self._command}' cannot be started: {reason}"
            raise ValueError(text) from None
        raise ValueError("a TraX server needs a command, such as 'python server.py'")


def _thread(work: Any, *arguments: Any) -> threading.Thread:
    thread = threading.Thread(target=work, args=arguments, daemon=True)
    thread.start()
    return thread


def _write(stdin: Any, questions: queue.Queue[str]) -> None:
    with suppress(OSError, ValueError):  # it has ended; the answer that does not come says so
        while line := questions.get():
            stdin.write(line.encode())
            stdin.flush()
    with suppress(OSError):
        stdin.close()


def _read(stdout: Any, answers: queue.Queue[Message | None]) -> None:
    with stdout:
        for line in iter(lambda: stdout.readline(LONGEST_LINE), b""):
            message = message_in(line.decode("utf-8", "replace"))
            if message is not None:
                _put(answers, message)
    _put(answers, None)


def _put(answers: queue.Queue[Message | None], message: Message | None) -> None:
    with suppress(queue.Full):  # nobody asked for that much
        answers.put_nowait(message)


def _note(stderr: Any, words: deque[str]) -> None:
    with stderr:
        for line in iter(lambda: stderr.readline(LONGEST_LINE), b""):
            if text := line.decode("utf-8", "replace").strip():
                words.append(text[:200])


def _end(
    process: subprocess.Popen[bytes],
    questions: queue.Queue[str],
    folder: tempfile.TemporaryDirectory[str],
) -> None:
    """End a server with all that it has started."""
    questions.put(Message("quit").line())
    questions.put("")
    with suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    with suppress(OSError):
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()
    folder.cleanup()
