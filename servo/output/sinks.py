"""Receivers ("sinks") of each step of a run or each picture of a track: films, recordings, logs,
viewers.

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
    """Protocol of a receiver of each frame of a run or a track, in order."""

    @property
    def add(self) -> Callable[..., None]:
        """The method that takes the next frame: a run's `Step`, or a track's `Shot` (picture and
        estimate) with the true corners (None without them). It raises an OSError or `Refused` if
        the frame cannot be written.
        """
        ...

    def close(self) -> None:
        """Finish the output; raise the errors of `add`."""

    def abandon(self) -> None:
        """End the output after an error, without finishing it."""


class Sinks:
    """Several sinks by name (the path of a file, or a word); each frame is given to all of them.

    A sink that fails is abandoned, the others go on, and `refused` keeps the first error.
    """

    refused: Refused | None = None
    """Error of the first sink that failed; None if none has."""

    def __init__(self, sinks: Mapping[Path | str, Sink]) -> None:
        self._sinks = dict(sinks)
        self.paths = [name for name in sinks if isinstance(name, Path)]

    def begin(self, path: Path, make: Callable[[], Sink]) -> None:
        """Add the sink that `make` returns and that writes the file at this path. An OSError of
        `make` is not raised; `refused` keeps it if it is the first error of these sinks.
        """
        try:
            self._sinks[path] = make()
        except OSError as error:
            self._refuse(path, error.strerror or str(error))
        else:
            self.paths.append(path)

    def __bool__(self) -> bool:
        return bool(self._sinks)

    def add(self, *given: object) -> None:
        """Give a frame (a run's `Step`, or a track's `Shot` with the true corners) to each sink. A
        sink that raises an OSError or `Refused` is abandoned; `refused` keeps the first such error.
        """
        for name, sink in list(self._sinks.items()):
            self._guarded(name, lambda sink=sink: sink.add(*given))

    def close(self) -> None:
        """Finish all sinks; the first OSError or `Refused` is kept in `refused`."""
        with closing(*(partial(self._guarded, name, s.close) for name, s in self._sinks.items())):
            pass

    def end(self, reason: str) -> None:
        """Abandon all sinks for this reason, such as "the disk is full"; `refused` keeps it unless
        a sink failed before.
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
    """Timer for work that is repeated at a fixed period of the wall clock, such as flushes."""

    def __init__(self, seconds: float = 1.0) -> None:
        self._seconds = seconds
        self._due = time.monotonic() + seconds

    def due(self) -> bool:
        """Return whether the period since the last time it was over, or since the timer was made,
        is over; if so, begin the next one.
        """
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


class PacedSink:
    """Sink that passes each frame on to another sink when it is due: in real time, or faster or
    slower by a factor.
    """

    def __init__(self, sink: Sink, speed: float, time_of: Callable[[Any], float]) -> None:
        """Wrap a sink.

        Args:
            sink: Gets the frames.
            speed: Simulated seconds in a second of the wall clock.
            time_of: Returns the time of a frame, given as a step of a run or a picture of a track
                [s].
        """
        self._sink = sink
        self._speed = speed
        self._time_of = time_of
        self.close = sink.close
        self.abandon = sink.abandon
        self._began: float | None = None

    def add(self, *given: object) -> None:
        """Wait until the frame is due (its time since the first frame, divided by the speed), and
        pass it on.
        """
        due = self._time_of(given[0]) / self._speed
        now = time.monotonic()
        if self._began is None:
            self._began = now - due
        time.sleep(max(0.0, self._began + due - now))
        self._sink.add(*given)
