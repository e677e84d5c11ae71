"""Receivers ("sinks") of a run's steps or a track's shots: films, recordings, logs, viewers.

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
        """The method that takes the next frame: a run's `Step`, or a track's `Shot` with its truth
        (None without one). It raises an OSError or `Refused` if the frame cannot be written.
        """
        ...

    def close(self) -> None:
        """Finish the output; raise the errors of `add`."""

    def abandon(self) -> None:
        """End the output after an error, without finishing it."""


class Sinks:
    """Sinks by name (the path of a file, or a word), to which each frame is given.

    A sink that fails is abandoned, the others go on, and `refused` keeps the first error.
    """

    refused: Refused | None = None
    """Error of the first sink that failed; None if none has."""

    def __init__(self, sinks: Mapping[Path | str, Sink]) -> None:
        self._sinks = dict(sinks)
        self.paths = [name for name in sinks if isinstance(name, Path)]

    def begin(self, path: Path, make: Callable[[], Sink]) -> None:
        """Make a sink that writes a file, and add it; an OSError counts as its failure."""
        try:
            self._sinks[path] = make()
        except OSError as error:
            self._refuse(path, error.strerror or str(error))
        else:
            self.paths.append(path)

    def __bool__(self) -> bool:
        return bool(self._sinks)

    def add(self, *given: object) -> None:
        """Give a frame to each sink; the arguments are those of `Sink.add`."""
        for name, sink in list(self._sinks.items()):
            self._guarded(name, lambda sink=sink: sink.add(*given))

    def close(self) -> None:
        """Finish all sinks."""
        with closing(*(partial(self._guarded, name, s.close) for name, s in self._sinks.items())):
            pass

    def end(self, reason: str) -> None:
        """Abandon all sinks for this reason, such as "the disk is full"."""
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
        self.refused = self.refused or Refused(f"{name}: this output ends too early: {reason}")


class Timer:
    """Timer for periodic work, such as flushes, by the wall clock."""

    def __init__(self, seconds: float = 1.0) -> None:
        self._seconds = seconds
        self._due = time.monotonic() + seconds

    def due(self) -> bool:
        """Return whether the period is over, and begin the next one if so."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


class PacedSink:
    """A sink that gets frames no faster than they happened, or by a factor faster or slower."""

    def __init__(self, sink: Sink, speed: float, time_of: Callable[[Any], float]) -> None:
        """Wrap a sink.

        Args:
            sink: Gets the frames.
            speed: Simulated seconds in a second of the wall clock.
            time_of: Returns the time of a step or a shot [s].
        """
        self._sink = sink
        self._speed = speed
        self._time_of = time_of
        self.close = sink.close
        self.abandon = sink.abandon
        self._began: float | None = None

    def add(self, *given: object) -> None:
        """Wait until the frame's time since the first frame, over the speed, and pass it on."""
        due = self._time_of(given[0]) / self._speed
        now = time.monotonic()
        if self._began is None:
            self._began = now - due
        time.sleep(max(0.0, self._began + due - now))
        self._sink.add(*given)
