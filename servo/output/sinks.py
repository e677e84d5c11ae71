"""Sinks of a run's steps or a track's shots, beside the rows: films, recordings, logs, viewers.

One that fails ends alone, and the others go on.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from servo.closing import closing
from servo.mistake import Refused


class Sink(Protocol):
    """Takes what there is of each frame: a `Step`; or a `Shot` and its truth, if there is one."""

    @property
    def add(self) -> Callable[..., None]:
        """Take the next frame; an OSError or `Refused` says that it cannot be written."""
        ...

    def close(self) -> None:
        """Finish; errors are those of `add`."""

    def abandon(self) -> None:
        """Leave everything as it is after an error."""


class Sinks:
    """Gives each step to several sinks, by name: the path of a written file, or a word. A sink that
    fails is abandoned, the others go on, and `refused` keeps the first reason.
    """

    refused: Refused | None = None
    """The reason why the first of them that failed is not complete; None if all are."""

    def __init__(self, sinks: Mapping[Path | str, Sink]) -> None:
        self._sinks = dict(sinks)
        self.paths = [name for name in sinks if isinstance(name, Path)]

    def begin(self, path: Path, make: Callable[[], Sink]) -> None:
        """Make a sink that writes a file, and give it the frames to come if it can be made."""
        try:
            self._sinks[path] = make()
        except OSError as error:
            self._refuse(path, error.strerror or str(error))
        else:
            self.paths.append(path)

    def __bool__(self) -> bool:
        return bool(self._sinks)

    def add(self, *given: Any) -> None:
        """Give a frame to each."""
        for name, sink in list(self._sinks.items()):
            self._guarded(name, lambda sink=sink: sink.add(*given))

    def close(self) -> None:
        """Finish each."""
        with closing(*(partial(self._guarded, name, s.close) for name, s in self._sinks.items())):
            pass

    def end(self, reason: str) -> None:
        """End all of them early."""
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
        self.refused = self.refused or Refused(f"{name}: it ends too early: {reason}")


class Every:
    """Says once in a while that it is time again, by the wall clock: what a kill may cost."""

    def __init__(self, seconds: float = 1.0) -> None:
        self._seconds = seconds
        self._due = time.monotonic() + seconds

    def due(self) -> bool:
        """Return whether so many seconds have passed since this was last true."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


class PacedSink:
    """A sink whose frames come no sooner than their times, since the first, over a speed."""

    def __init__(self, sink: Sink, speed: float, time_of: Callable[[Any], float]) -> None:
        """Pace a sink; `time_of` gives the time of a step or a shot [s]."""
        self._sink = sink
        self._speed = speed
        self._time_of = time_of
        self.close = sink.close
        self.abandon = sink.abandon
        self._began: float | None = None

    def add(self, *given: Any) -> None:
        """Wait until it is time, and pass a frame on."""
        due = self._time_of(given[0]) / self._speed
        now = time.monotonic()
        if self._began is None:
            self._began = now - due
        time.sleep(max(0.0, self._began + due - now))
        self._sink.add(*given)
