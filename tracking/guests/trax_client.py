"""Client for a tracker in another process that speaks the TraX protocol (Cehovin 2017)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from sim.types import Array, Frame, Image
from tracking.guests.boxes import exact_box
from tracking.guests.process import GuestProcess
from tracking.guests.report import (
    DIGITS,
    UNSEEN,
    Gives,
    Report,
    box_around,
    confidence_in,
    convex,
    gives_in,
    is_upright,
    report_in,
    report_of_corners,
)
from tracking.guests.trax_messages import (
    CONFIDENCE,
    CORNERS,
    NOT_SEEN,
    SEEN,
    Message,
    mask_text,
    message_in,
    picture_text,
    region_in,
    region_text,
)
from tracking.types import Region, State

TOGETHER = {"1", "2", "3"}
"""Versions of TraX whose first message holds region and picture."""
SEPARATE = "4"
"""The version that sends region and picture in two messages."""
PICTURES = frozenset({"path", "memory", "buffer", "data"})
"""Formats of the pictures that we can send."""
REGIONS = frozenset({"rectangle", "polygon", "mask"})
"""Formats of the regions that we can send."""


class TraxClient:
    """Connection to a tracker that is a server of the TraX protocol; the server is ended when this
    object is deleted. `loading` is the longest wait for its first message (hello), `timeout` for
    the answer to a picture [s].
    """

    def __init__(self, command: str, timeout: float, loading: float) -> None:
        """Start a server and wait for its hello.

        Args:
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            timeout: Longest wait for the answer to a picture [s].
            loading: Longest wait for the hello, before which the server loads what it needs [s].

        Raises:
            ValueError: The server does not start, sends no hello, speaks another version of TraX,
                accepts none of our formats of regions or pictures, needs other channels than
                color, or declares that it gives something unknown.
        """
        goodbye = Message("quit").line().encode()
        self._server = GuestProcess("TraX server", command, {"TRAX": "1"}, goodbye)
        self._timeout = timeout
        self._count = 0
        self._turns = False
        """Whether the server has reported a polygon that is not upright since `start`."""
        hello = self._ask("hello", loading).named
        self.gives: frozenset[Gives] | None = None
        """What the argument trax.gives of the hello declares; None: it has none."""
        if "trax.gives" in hello:
            self.gives = gives_in(_words(hello, "gives", ""), self._server.name)
        version = hello.get("trax.version", "1")
        if version not in (*TOGETHER, SEPARATE):
            self._server.fail(f"speaks version '{version}' of TraX; servobench speaks 1 to 4")
        self._separate = version == SEPARATE
        self._pictures = self._taken(_words(hello, "image", "path"), PICTURES, "picture")
        self._regions = self._taken(_words(hello, "region", "rectangle"), REGIONS, "region")
        self.cuts = "polygon" not in self._regions
        """Whether the server is shown the region's box cut off at the picture's border."""
        if (channels := _words(hello, "channels", "color")) != ["color"]:
            self._server.fail(
                f"needs the channels {', '.join(channels)}; servobench sends color only"
            )

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Send the first picture, in which the target is the rectangle `region` [px] at `state`,
        and wait for the server's answer, whose region is not used.

        Raises:
            ValueError: The server has ended, does not answer in time, or sends another message than
                a state.
        """
        self._turns = False
        corners = region.corners(state)
        if "polygon" in self._regions:
            words = region_text(corners)
        elif "rectangle" in self._regions:
            words = region_text(exact_box(region, state, frame.image))
        else:
            words = mask_text(corners, frame.image)
        picture = self._picture(frame.image)
        if self._separate:
            messages = Message("initialize", (words,)), Message("frame", (picture,))
        else:
            messages = (Message("initialize", (picture, words)),)
        self._ask("state", self._timeout, *messages)

    def update(self, frame: Frame) -> Report:
        """Send the next picture, and return the server's report: box or corners [px], and the
        confidence if the server sends one.

        Raises:
            ValueError: The server has ended or does not answer in time, its answer is not a region
                with an area, or its confidence is not from 0 to 1.
        """
        message = Message("frame", (self._picture(frame.image),))
        answer = self._ask("state", self._timeout, message)
        try:
            found = region_in(*answer.arguments)
        except (TypeError, ValueError) as error:
            reason = error if isinstance(error, ValueError) else "expected one region"
            self._server.fail(f"answered {answer.line().strip()[:80]}, which is wrong: {reason}")
        is_seen = found is not None and answer.named.get(SEEN) != NOT_SEEN
        report = self._report(found) if found is not None and is_seen else UNSEEN
        if CONFIDENCE not in answer.named:
            return report
        text = answer.named[CONFIDENCE]
        try:
            sure = confidence_in(float(text), self._server.name)
        except ValueError:
            self._server.fail(f"reports the confidence '{text[:40]}'; it must be from 0 to 1")
        return replace(report, confidence=sure)

    def _report(self, found: Array) -> Report:
        """Return the report of a box (4,), or of a polygon (n, 2) [px]: four corners that go around
        a convex region are kept, any other polygon is replaced by the box around it. An upright
        polygon is a box, unless an earlier one has shown that the server measures the angle.

        Raises:
            ValueError: The box has no area.
        """
        if found.ndim > 1 and len(found) == CORNERS and convex(found):
            self._turns = self._turns or not is_upright(found)
            return Report(corners=found.round(DIGITS)) if self._turns else report_of_corners(found)
        box = found if found.ndim == 1 else box_around(found)
        try:
            return report_in(box.tolist(), self._server.name)
        except ValueError:
            self._server.end()
            raise

    def _picture(self, image: Image) -> str:
        """Return a picture as the argument of a message, in a format that the server accepts; of
        pictures sent as files, the last two files are kept.
        """
        self._count += 1
        folder = self._server.folder
        (folder / f"{self._count - 2:08}.png").unlink(missing_ok=True)
        return picture_text(image, self._pictures, folder / f"{self._count:08}.png")

    def _taken(self, offered: Sequence[str], ours: frozenset[str], what: str) -> Sequence[str]:
        """Return the formats that a server accepts, checked to hold one of ours.

        Raises:
            ValueError: None of ours is among them.
        """
        if not ours & set(offered):
            self._server.fail(
                f"accepts a {what} only as {', '.join(offered)}; servobench sends "
                f"{', '.join(sorted(ours))}"
            )
        return offered

    def _ask(self, expected: str, limit: float, *messages: Message) -> Message:
        """Send messages, and return the server's answer, a message of the type `expected`.

        Args:
            expected: Type of the answer.
            limit: Longest wait for the answer [s].
            *messages: The messages.

        Raises:
            ValueError: The server has ended, does not answer in time, or answers with another type.
        """
        sent = [message.line().encode() for message in messages]
        answer = self._server.ask(
            sent, lambda line: message_in(line.decode("utf-8", "replace")), limit, f"'{expected}'"
        )
        if answer.type == "quit":
            self._server.fail_ended(f"'{expected}'")
        if answer.type != expected:
            self._server.fail(f"sent '{answer.type}' instead of '{expected}'")
        return answer


def _words(hello: Mapping[str, str], key: str, default: str) -> list[str]:
    """Return the words in the argument trax.KEY of a hello, else those of a default."""
    return [word for word in (hello.get(f"trax.{key}") or default).split(";") if word]
