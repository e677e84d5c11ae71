"""Sinks: receivers of each step of a run or each picture of a track, such as films, recordings,
logs and viewers.

A sink that fails is ended, and the others go on.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from servo.closing import closing
from servo.mistake import Refused


class Sink(Protocol):
    """Protocol of a receiver of all frames of a run or a track, in order: `add` is called with each
    frame, then either `close`, or `abandon` after an error.
    """

    @property
    def add(self) -> Callable[..., None]:
        """Function that takes the next frame. Its arguments are a run's `Step`; or a track's `Shot`
        (picture and estimate) and the target's true corners (4, 2) [px] (None: unknown). It raises
        an OSError or `Refused` if the frame cannot be written.
        """
        ...

    def close(self) -> None:
        """Finish the output after the last frame; it may raise an OSError or `Refused`, as
        `add`.
        """

    def abandon(self) -> None:
        """End the output after an error, without finishing it; what is written so far may stay."""


class Sinks:
    """Several sinks (receivers of frames) by name, which is the path of the file that a sink
    writes, or a word. Each frame is given to all of them.

    A sink that fails is abandoned, the others go on, and `refused` keeps the first error. An object
    without sinks is false.
    """

    refused: Refused | None = None
    """Error of the first sink that failed; None if none has."""

    def __init__(self, sinks: Mapping[Path | str, Sink]) -> None:
        self._sinks = dict(sinks)

    def begin(self, path: Path, make: Callable[[], Sink]) -> None:
        """Add a sink.

        Args:
            path: The file that the sink writes.
            make: Function that returns the sink. Its OSError is not raised: no sink is added, and
                `refused` keeps the error if it is the first.
        """
        try:
            self._sinks[path] = make()
        except OSError as error:
            self._refuse(path, error.strerror or str(error))

    @property
    def paths(self) -> list[Path]:
        """Files of the sinks that have not failed."""
        return [name for name in self._sinks if isinstance(name, Path)]

    def __bool__(self) -> bool:
        return bool(self._sinks)

    def add(self, *given: object) -> None:
        """Give a frame to each sink: a run's `Step`, or a track's `Shot` and the true corners. A
        sink that raises an OSError or `Refused` is abandoned; `refused` keeps the first such error.
        """
        for name, sink in list(self._sinks.items()):
            self._guarded(name, lambda sink=sink: sink.add(*given))

    def close(self) -> None:
        """Finish all sinks. An OSError or `Refused` of a sink is not raised: `refused` keeps the
        first one.
        """
        with closing(*(partial(self._guarded, name, s.close) for name, s in self._sinks.items())):
            pass

    def end(self, reason: str) -> None:
        """Abandon all sinks for a reason, such as "the disk is full". `refused` is then an error
        that gives this reason, unless a sink failed before or there are no sinks.
        """
        for name in list(self._sinks):
            self._end(name, reason)

    def _guarded(self, name: Path | str, act: Callable[[], None]) -> None:
        try:
            act()
        except OSError as error:
            self._end(name, error.strerror or str(error))
        except Refused as error:
            self._end(name, str(error).rpartition(": ")[2])

    def _end(self, name: Path | str, reason: str) -> None:
        self._sinks.pop(name).abandon()
        self._refuse(name, reason)

    def _refuse(self, name: Path | str, reason: str) -> None:
        self.refused = self.refused or Refused(
            f"{name}: this output ends too early (run again for all of it): {reason}"
        )


class Timer:
    """Timer for work that is repeated about every `seconds` of the wall clock, such as flushes."""

    def __init__(self, seconds: float = 1.0) -> None:
        self._seconds = seconds
        self._due = time.monotonic() + seconds

    def due(self) -> bool:
        """Return True, and start the next period, if the period is over that began when this method
        last returned True (or when the timer was made); else return False.
        """
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


class PacedSink:
    """Sink (receiver of frames) that passes each frame on to another sink when the frame is due.
    `speed` is the number of seconds of the run or track in a second of the wall clock (1: real
    time); `time_of` returns the time [s] of a frame in the run or track.
    """

    def __init__(self, sink: Sink, speed: float, time_of: Callable[[Any], float]) -> None:
        """Wrap a sink.

        Args:
            sink: Gets the frames.
            speed: Seconds of the run or track in a second of the wall clock.
            time_of: Function that returns the time [s] of a run's `Step` or a track's `Shot`.
        """
        self._sink = sink
        self._speed = speed
        self._time_of = time_of
        self.close = sink.close
        self.abandon = sink.abandon
        self._began: float | None = None

    def add(self, *given: object) -> None:
        """Wait until a frame is due, and pass it on to the other sink. A frame is due when its time
        after the first frame, divided by the speed, has passed on the wall clock since the first
        call of this method.
        """
        due = self._time_of(given[0]) / self._speed
        now = time.monotonic()
        if self._began is None:
            self._began = now - due
        time.sleep(max(0.0, self._began + due - now))
        self._sink.add(*given)
