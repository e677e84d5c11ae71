"""A live source: a thread reads a camera or a stream, and a slower tracker gets the newest picture.

Between them is a queue for one picture. A new picture replaces one that was not taken yet, so that
a tracker is never late by more than the picture at which it works; what was replaced is counted.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from queue import Empty, Full, Queue

from sim.types import Image
from tracking.sequences.sources import RATE, End, Picture, Times

WAKE = 0.1
"""Time after which a waiting thread checks that the other one goes on [s]: short for Ctrl-C."""
Item = tuple[int, float | None, Image]


class SourceLost(Exception):
    """A camera or stream cannot be opened, or broke off; the reason."""


@dataclass(frozen=True, slots=True)
class Feed:
    """An open camera or stream."""

    pictures: Iterator[tuple[float | None, Image | None]]
    """Stamps [s] and pictures, None where one cannot be decoded; raises SourceLost."""
    rate: float = RATE
    waits: bool = False
    """True for a recording on a server, which waits for the tracker; nothing is dropped."""


class LiveSource:
    """Pictures of a camera or stream, which can be read once."""

    count: int | None = None

    def __init__(self, name: str, opened: Callable[[], AbstractContextManager[Feed]]) -> None:
        """Make a source that opens when it is read.

        Args:
            name: What it is called in messages.
            opened: Opens it; raises SourceLost.
        """
        self.name = name
        self.rate = RATE
        self._opened = opened
        self._queue: Queue[Item] = Queue(maxsize=1)
        self._stop = threading.Event()
        self._given = self._dropped = 0
        self._over = False
        self._broken = ""

    @property
    def end(self) -> End | None:
        """The end, and the number of dropped pictures."""
        many = f"{self.name}: {self._given + self._dropped} pictures"
        slow = f"{self._dropped} of them were dropped, because the tracker was slower"
        slow = f"; {slow}" if self._dropped else ""
        if self._broken:
            return End(f"{many}, then it was lost: {self._broken}{slow}", True, self._dropped)
        if self._over:
            return End(f"{many}, then it ended{slow}", False, self._dropped)
        return End(f"{many}{slow}", False, self._dropped) if slow else None

    def __iter__(self) -> Iterator[Picture]:
        reader = threading.Thread(target=self._read, daemon=True)
        reader.start()
        try:
            times = None
            while (item := self._next(reader)) is not None:
                index, stamp, image = item
                times = times or Times(self.rate)
                self._given += 1
                yield Picture(f"frame {index}", times.since_first(stamp), image)
            if not self._given:
                reason = self._broken or "there are no pictures in it"
                raise ValueError(f"{self.name}: {reason}")
            self._over = True
        finally:
            self._stop.set()
            reader.join(WAKE)  # one that waits for a camera ends by itself later

    def _next(self, reader: threading.Thread) -> Item | None:
        while True:
            with suppress(Empty):
                return self._queue.get(timeout=WAKE)
            if not reader.is_alive() and self._queue.empty():
                return None

    def _read(self) -> None:
        index = 0
        try:
            with self._opened() as feed:
                self.rate = feed.rate
                for stamp, image in feed.pictures:
                    if image is not None:
                        self._put((index, stamp, image), wait=feed.waits)
                        index += 1
                    if self._stop.is_set():
                        return
        except SourceLost as error:
            self._broken = str(error)

    def _put(self, item: Item, *, wait: bool) -> None:
        while not self._stop.is_set():
            with suppress(Full):
                return self._queue.put(item, timeout=WAKE if wait else 0.0)
            if not wait:
                with suppress(Empty):
                    self._queue.get_nowait()
                    self._dropped += 1
        return None
