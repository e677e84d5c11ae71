"""A conversation with a program of another author in lines of JSON, each perhaps followed by the
raw bytes of a picture.
"""

import json
from collections.abc import Mapping
from typing import NoReturn, cast, final

from sim.types import Image
from tracking.guests.process import GuestProcess

Line = Mapping[str, object]
"""A line of JSON: an object."""


@final
class JsonLines:
    """Connection to a running program that answers each line of JSON with a line of JSON; the
    program is ended when this object is deleted.
    """

    def __init__(self, command: str, seed: int, timeout: float, loading: float) -> None:
        """Start a program and wait until it is ready.

        Args:
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            seed: Seed for the program's random numbers.
            timeout: Longest wait for the answer to a picture [s].
            loading: Longest wait for the first answer [s].

        Raises:
            ValueError: The command is empty, or the program does not start, sends no line of JSON,
                or reports an error.
        """
        self._program = GuestProcess("program", command, {})
        self.name = self._program.name
        """What messages call the program."""
        self._timeout = timeout
        self.ready = self._ask({"seed": seed}, b"", loading)
        """The first answer."""

    def show(self, picture: Image, more: Line) -> Line:
        """Send a line with a picture's width and height [px] and the keys of `more`, then the bytes
        of the RGB picture (H, W, 3) of uint8; return the program's answer.

        Raises:
            ValueError: The program has ended, does not answer in time or with an object of JSON, or
                reports an error.
        """
        height, width = picture.shape[:2]
        line = {"width": width, "height": height, **more}
        return self._ask(line, picture.tobytes(), self._timeout)

    def _ask(self, line: Line, picture: bytes, limit: float) -> Line:
        """Send a line and the bytes of a picture, and return the answer within a limit [s].

        Raises:
            ValueError: The program has ended, hangs, answers something else than an object of JSON,
                or reports an error.
        """
        sent = [json.dumps(line).encode() + b"\n", picture]
        answer = self._program.ask(sent, self._object_in, limit, "a line of JSON")
        if "error" in answer:
            self._program.fail(f"refused: {' '.join(str(answer['error']).split())[:200]}")
        return answer

    def fail(self, fault: str) -> NoReturn:
        """End the program, and raise a ValueError with its name, a fault such as "answered 3", and
        the last lines of its stderr.
        """
        self._program.fail(fault)

    def end(self) -> None:
        """End the program and the processes that it has started, except those in a process group
        of their own.
        """
        self._program.end()

    def _object_in(self, line: bytes) -> Line | None:
        """Return the object of JSON in a line of output; None for other output.

        Raises:
            ValueError: The line begins with "{" but is no JSON.
        """
        if not line.lstrip().startswith(b"{"):
            return None
        try:
            return cast("Line", json.loads(line))
        except (ValueError, RecursionError) as error:
            text = " ".join(line.decode("utf-8", "replace").split())[:80]
            reason = "too deep" if isinstance(error, RecursionError) else error
            self._program.fail(f"answered {text}, which is no JSON: {reason}")
