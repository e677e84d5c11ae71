"""Client for a tracker that runs in another process, a server, and speaks the TraX protocol."""

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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import numpy as np

from sim.types import Array, Image
from tracking.types import Region, State
from tracking.wrapped.boxes import Box, box_in, box_of, convex, score_in
from tracking.wrapped.trax_messages import (
    CONFIDENCE,
    CORNERS,
    SEEN,
    UNSEEN,
    Message,
    box_around,
    message_in,
    picture_text,
    region_in,
    region_text,
)

TOGETHER = {"1", "2", "3"}
"""Versions of TraX whose first message holds region and picture; later versions send two."""
PICTURES = frozenset({"path", "memory", "buffer", "data"})
"""Formats of the pictures that we can send."""
REGIONS = frozenset({"rectangle", "polygon"})
"""Formats of the regions that we can send."""
LAST_LINES = 3
"""Number of lines of a server's stderr that an error quotes."""
LONGEST_LINE = 1 << 24
"""Most bytes of a server's output that are read at once: output without an end of line cannot fill
the memory."""
GRACE = 0.5
"""Time between the request to quit and the kill of a server [s]."""
KEEPER = 'read -r _; kill -s KILL -- "-$1"; rm -rf -- "$2"'
"""Shell script that kills a server with its children and removes its folder, as soon as the script
reads a line or the end of its input, which ends also when our own process is killed."""


class TraxClient:
    """Connection to a TraX server (a `RegionSource`); the server is ended with this object."""

    def __init__(self, command: str, timeout: float) -> None:
        """Start a server, a tracker in another process, and wait for its first message (hello).

        Args:
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            timeout: Longest wait for an answer [s].

        Raises:
            ValueError: The server does not start, sends no hello, or accepts none of our formats of
                regions or pictures.
        """
        if not command.strip():
            raise ValueError(
                "the command of the TraX server is empty: give one, such as 'python server.py'"
            )
        self._name = f"TraX server '{command}'"
        self._timeout = timeout
        self._folder = Path(tempfile.mkdtemp(prefix="trax-"))
        process = self._process = self._started(command)
        script = ["sh", "-c", KEEPER, "sh", str(process.pid), str(self._folder)]
        keeper = subprocess.Popen(
            script, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self._answers = _messages(process)
        self._close = weakref.finalize(self, _end, process, keeper)
        self._count = 0
        hello = self._ask("hello").named
        self._separate = hello.get("trax.version", "1") not in TOGETHER
        self._pictures = self._taken(_words(hello, "image", "path"), PICTURES, "picture")
        self._regions = self._taken(_words(hello, "region", "rectangle"), REGIONS, "region")
        if (channels := _words(hello, "channels", "color")) != ["color"]:
            self._fail(f"needs the channels {', '.join(channels)}; servobench sends color only")

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Send the first picture, RGB (H, W, 3), and the target's region at a state.

        Returns:
            The upright box x, y, width, height [px] around the region.

        Raises:
            ValueError: The server has ended, hangs, or sends no answer.
        """
        box = box_of(region, state, image)
        target = region_text(region.corners(state) if "polygon" in self._regions else np.array(box))
        picture = self._picture(image)
        if self._separate:
            self._ask("state", Message("initialize", (target,)), Message("frame", (picture,)))
        else:
            self._ask("state", Message("initialize", (picture, target)))
        return box

    def update(self, image: Image) -> Array | None:
        """Send the next picture, RGB (H, W, 3), and return the target's region in it [px].

        Returns:
            A box (4,) of x, y, width, height, or the corners (4, 2) of a convex quadrilateral;
            None where the server does not see the target.

        Raises:
            ValueError: The server has ended, hangs, or its answer is not a region.
        """
        answer = self._ask("state", Message("frame", (self._picture(image),)))
        self._named = answer.named
        try:
            found = region_in(*answer.arguments)
        except (TypeError, ValueError) as error:
            reason = error if isinstance(error, ValueError) else "not one region"
            self._fail(f"answered {answer.line().strip()[:80]}, which is {reason}")
        if found is None or answer.named.get(SEEN) == UNSEEN:
            return None
        if found.ndim == 1:
            return box_in(found, self._name)
        box = box_in(box_around(found), self._name)
        return found if len(found) == CORNERS and convex(found) else box

    def score(self) -> float:
        """Return the confidence that the server sent with its last answer, from 0 (lost) to 1
        (certain).

        Raises:
            ValueError: The server sent no confidence, or not a number of 0 to 1.
        """
        if CONFIDENCE not in self._named:
            raise ValueError(
                f'{self._name} reports no {CONFIDENCE}; set judge = "histogram", which needs none'
            )
        return score_in(self._named[CONFIDENCE], self._name)

    def _picture(self, image: Image) -> str:
        """Return a picture as the argument of a message, in a format that the server accepts; of
        pictures sent as files, the last two files are kept.
        """
        self._count += 1
        (self._folder / f"{self._count - 2:08}.png").unlink(missing_ok=True)
        return picture_text(image, self._pictures, self._folder / f"{self._count:08}.png")

    def _taken(self, offered: Sequence[str], ours: frozenset[str], what: str) -> Sequence[str]:
        """Return the formats that a server accepts, checked to hold one of ours.

        Raises:
            ValueError: None of ours is among them.
        """
        if not ours & set(offered):
            self._fail(
                f"accepts a {what} only as {', '.join(offered)}; servobench sends "
                f"{', '.join(sorted(ours))}"
            )
        return offered

    def _ask(self, expected: str, *messages: Message) -> Message:
        """Send messages, and return the server's answer, which has the expected type.

        Raises:
            ValueError: The server has ended, hangs, or answers with another type.
        """
        # A server that hangs blocks our reading and writing: its kill ends both.
        began = time.monotonic()
        late = threading.Timer(self._timeout, os.killpg, (self._process.pid, signal.SIGKILL))
        late.start()
        try:
            _send(self._process, *messages)
            answer = next(self._answers, None)
        finally:
            late.cancel()
        if answer is None and time.monotonic() - began >= self._timeout:
            self._fail(f"sent no '{expected}' within {self._timeout:g} s")
        if answer is None or answer.type == "quit":
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            code = self._process.poll()
            ended = "ended" if code is None else f"ended with code {code}"
            self._fail(f"{ended} instead of sending '{expected}'")
        if answer.type != expected:
            self._fail(f"sent '{answer.type}' instead of '{expected}'")
        return answer

    def _fail(self, fault: str) -> NoReturn:
        """End the server, and raise a ValueError with its name, a fault and the last lines of its
        stderr.
        """
        with self._log.open("rb") as log:
            lines = deque(filter(bytes.strip, log), LAST_LINES)
        self._close()
        words = " | ".join(line.decode("utf-8", "replace").strip()[:200] for line in lines)
        raise ValueError(f"{self._name} {fault}{words and f': {words}'}") from None

    def _started(self, command: str) -> subprocess.Popen[bytes]:
        """Return the process of the server, whose stderr goes to a file.

        Raises:
            ValueError: The command cannot be started.
        """
        self._log = self._folder / "stderr.txt"
        try:
            with self._log.open("wb") as log:
                return subprocess.Popen(
                    shlex.split(command),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    start_new_session=True,
                    env=os.environ | {"TRAX": "1"},
                )
        except (OSError, ValueError) as error:
            shutil.rmtree(self._folder)
            reason = getattr(error, "strerror", None) or error
            raise ValueError(f"{self._name} cannot be started: {reason}") from None


def _words(hello: Mapping[str, str], key: str, default: str) -> list[str]:
    """Return the formats in the argument trax.KEY of a hello, else those of a default."""
    return [word for word in (hello.get(f"trax.{key}") or default).split(";") if word]


def _send(process: subprocess.Popen[bytes], *messages: Message) -> None:
    """Send messages to a server; a server that has ended is ignored, as it will not answer."""
    assert process.stdin is not None  # a pipe
    with suppress(OSError):
        process.stdin.write("".join(message.line() for message in messages).encode())
        process.stdin.flush()


def _messages(process: subprocess.Popen[bytes]) -> Iterator[Message]:
    """Yield the messages that a server sends until it ends; its other output is skipped."""
    assert process.stdout is not None  # a pipe
    while line := process.stdout.readline(LONGEST_LINE):
        if message := message_in(line.decode("utf-8", "replace")):
            yield message


def _end(process: subprocess.Popen[bytes], keeper: subprocess.Popen[bytes]) -> None:
    """End a server and the processes that it has started, by the process `keeper`, which also
    removes the server's folder.
    """
    _send(process, Message("quit"))
    with suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    keeper.communicate(b"\n")
    process.communicate()
