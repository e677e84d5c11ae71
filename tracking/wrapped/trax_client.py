"""A tracker in a process of its own that speaks the TraX protocol: starts, asks and ends it."""

import os
import queue
import shlex
import signal
import subprocess
import tempfile
import threading
import weakref
from contextlib import suppress
from pathlib import Path
from typing import IO, NoReturn

from sim.types import Array, Image
from tracking.wrapped.trax_messages import (
    Message,
    message_in,
    picture_text,
    region_in,
    region_text,
)

TOGETHER = {"1", "2", "3"}
"""Versions in which region and first picture come in one message; later, they come in two."""
PICTURES = {"path", "memory", "buffer", "data"}
"""Formats in which we send pictures."""
REGIONS = {"rectangle", "polygon"}
"""Forms in which we send regions."""
LAST_LINES = 3
"""Lines of a server's stderr that an error quotes."""
GRACE = 0.5
"""Time that a server has to end by itself [s]."""

Answers = queue.SimpleQueue[Message | None]
Questions = queue.SimpleQueue[str]


class TraxClient:
    """One server. It ends with this object, or with Python."""

    def __init__(self, command: str, timeout: float) -> None:
        """Start a server and wait for its hello.

        Args:
            command: The program with its arguments, as in a shell, but run without one.
            timeout: Longest wait for an answer [s].

        Raises:
            ValueError: It cannot be started, sends no hello, or takes neither our regions nor our
                pictures.
        """
        if not command.strip():
            raise ValueError("a TraX server needs a command, such as 'python server.py'")
        self._command = command
        self._timeout = timeout
        self._folder = tempfile.TemporaryDirectory(prefix="trax-")
        self._log = Path(self._folder.name) / "stderr.txt"
        self._process = self._started()
        # Reading and writing have threads of their own: a server that hangs blocks both.
        self._answers = Answers()
        self._questions = Questions()
        self.close = weakref.finalize(self, _end, self._process, self._questions, self._folder)
        """Ask the server to end, and end it."""
        for work, pipe in ((_write, self._questions), (_read, self._answers)):
            threading.Thread(target=work, args=(self._process, pipe), daemon=True).start()
        self._count = 0
        hello = self._answer("hello").named

        def listed(key: str, default: str) -> list[str]:
            return [word for word in (hello.get(f"trax.{key}") or default).split(";") if word]

        self._separate = hello.get("trax.version", "1") not in TOGETHER
        self._pictures = listed("image", "path")
        regions = listed("region", "rectangle")
        self.polygons = "polygon" in regions
        """True if the server takes four corners; else it takes boxes."""
        if not REGIONS & set(regions):
            self._fail(f"takes {', '.join(regions)} as region; we have rectangle, polygon")
        if not PICTURES & set(self._pictures):
            here = ", ".join(sorted(PICTURES))
            self._fail(f"takes {', '.join(self._pictures)} as picture; we have {here}")
        if (channels := listed("channels", "color")) != ["color"]:
            self._fail(f"needs the channels {', '.join(channels)}; we have color")

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
        """Return the target's region in the next picture, and the server's named values.

        Args:
            image: RGB (H, W, 3).

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
            self._fail(f"answered {answer.line().strip()[:80]}, which is {reason}")

    def _picture(self, image: Image) -> str:
        """Return a picture as the server takes it: where it is a file, the last two stay."""
        folder = Path(self._folder.name)
        self._count += 1
        (folder / f"{self._count - 2:08}.png").unlink(missing_ok=True)
        return picture_text(image, self._pictures, folder / f"{self._count:08}.png")

    def _ask(self, *messages: Message) -> Message:
        with suppress(queue.Empty):
            early = self._answers.get_nowait()
            if early is not None:
                self._fail(f"said {early.type} unasked")
            self._answers.put(None)  # it has ended: `_answer` says so
        for message in messages:
            self._questions.put(message.line())
        return self._answer("state")

    def _answer(self, expected: str) -> Message:
        try:
            answer = self._answers.get(timeout=self._timeout)
        except queue.Empty:
            self._fail(f"said no {expected} within {self._timeout:g} s")
        if answer is None or answer.type == "quit":
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            code = self._process.poll()
            ended = "ended" if code is None else f"ended with code {code}"
            self._fail(f"{ended} where its {expected} is expected")
        if answer.type != expected:
            self._fail(f"said {answer.type} where its {expected} is expected")
        return answer

    def _fail(self, fault: str) -> NoReturn:
        """End the server, and raise its fault with the last lines of its stderr."""
        lines = self._log.read_text("utf-8", "replace").split("\n")
        words = [line.strip()[:200] for line in lines if line.strip()]
        self.close()
        said = f": {' | '.join(words[-LAST_LINES:])}" if words else ""
        raise ValueError(f"TraX server '{self._command}' {fault}{said}") from None

    def _started(self) -> subprocess.Popen[bytes]:
        try:
            words = shlex.split(self._command)
            with self._log.open("wb") as log:
                return subprocess.Popen(
                    words,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    start_new_session=True,
                    env=os.environ | {"TRAX": "1"},
                )
        except (OSError, ValueError) as error:
            self._folder.cleanup()
            reason = getattr(error, "strerror", None) or error
            text = f"TraX server '{self._command}' cannot be started: {reason}"
            raise ValueError(text) from None


def _write(process: subprocess.Popen[bytes], questions: Questions) -> None:
    stdin = _pipe(process.stdin)
    with suppress(OSError), stdin:  # it has ended; the answer that does not come says so
        while line := questions.get():
            stdin.write(line.encode())
            stdin.flush()


def _read(process: subprocess.Popen[bytes], answers: Answers) -> None:
    with _pipe(process.stdout) as stdout:
        for line in stdout:
            if message := message_in(line.decode("utf-8", "replace")):
                answers.put(message)
    answers.put(None)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None  # `Popen` was asked for it
    return pipe


def _end(
    process: subprocess.Popen[bytes],
    questions: Questions,
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
