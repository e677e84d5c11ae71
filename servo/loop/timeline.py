"""When a picture arrives, when the tracker takes it, and when the command acts: simulated time.

A picture is there when it was exposed and transported. A free tracker takes the newest one; its
estimate is there `run.tracker_ms` later, and pictures in between are skipped. A dropped frame takes
the tracker no time, and none is taken where there is a picture. The law runs once an estimate. Its
command acts `run.latency` frame intervals later, from the next update of the drives on; until then
the robot goes on with the command that it has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from servo.loop.loop import Loop
from servo.loop.posture_record import PostureRecord
from servo.scenario.sections import RunConfig
from servo.types import Command
from sim.types import Array, Frame, Posture, Truth

SAME = 1e-9
"""Times that differ by less are the same [s]."""


@dataclass(frozen=True, slots=True)
class Taken:
    """A picture, and what was true and known when it was taken."""

    frame: Frame
    posture: Posture
    truth: Truth


@dataclass(frozen=True, slots=True)
class Decision:
    """What the loop last made of a picture."""

    truth: Truth
    """Of the time when that picture was taken."""
    command: Command
    age: float = 0.0
    """From the picture to its estimate [s]."""
    skipped: int = 0
    """Pictures since the run began that the tracker had no time for."""


@dataclass(frozen=True, slots=True)
class _Work:
    """A picture that the tracker has taken."""

    taken: Taken
    posture: Posture
    done: float
    """When its estimate is there [s]."""


def mean_twist(twists: Array) -> Array:
    """The mean (6,) of twists (n, 6), exact where they are all the same."""
    return twists[0] if (twists == twists[0]).all() else twists.mean(axis=0)


@final
class Timeline:
    """Shows a loop the pictures of a run, each at its time, and holds its commands."""

    decision: Decision
    """The last one."""
    seconds: tuple[float, float]
    """Wall-clock time of tracker and law in the last frame interval [s]."""

    def __init__(
        self,
        run: RunConfig,
        loop: Loop,
        period: float,
        ticks: Array,
        rng: np.random.Generator,
        first: Truth,
        motion_true: Callable[[Truth, float, float], Array],
        clock_offset: float = 0.0,
        *,
        steered: bool = False,
    ) -> None:
        """Begin.

        Args:
            run: The delays.
            loop: It has been started.
            period: Frame interval [s].
            ticks: When the drives take over a command (n,), after a frame [s].
            rng: Draws how long pictures are transported.
            first: The truth at the first picture.
            motion_true: The true mean de/dt (k,) of the target's own motion between two times, seen
                by the camera that took the picture of a truth; for a loop that needs it.
            clock_offset: Stamp minus true time of a picture [s].
            steered: Whether twists other than the law's will act; the law then gets those.
        """
        self._run = run
        self._loop = loop
        self._period = period
        self._ticks = ticks
        self._rng = rng
        self._motion_true = motion_true
        on_time = run.tracker_ms == 0 and run.jitter_ms == 0 and clock_offset == 0
        self._plain = on_time and not steered
        self._record = PostureRecord(period, clock_offset)
        self._coming: list[tuple[float, Taken]] = []
        self._arrival = self._free = 0.0
        self._work: _Work | None = None
        self._skipped = 0
        self._is_first = True
        self.decision = Decision(first, Command(np.zeros(6)))
        self.seconds = (0.0, 0.0)
        self._asked = np.zeros(6)
        self._commands: list[tuple[float, Array]] = [(0.0, np.zeros(6))]

    def advance(self, taken: Taken) -> None:
        """All that is decided from a picture to the next one."""
        now = self._now = taken.frame.time
        end = now + self._period - SAME
        self._decided = 0
        self.seconds = (0.0, 0.0)
        if not self._plain:
            self._record.add(taken.frame.index, replace(taken.posture, asked=self._asked))
        self._arrival = max(self._arrival, now + self._transport())
        self._coming.append((self._arrival, taken))
        while self._goes_on(end):
            pass

    def steer(self, twist: Array) -> None:
        """Let another twist (6,) act in place of what was decided since the last picture."""
        if self._decided:
            last = self._commands[-self._decided :]
            self._commands[-self._decided :] = [(at, twist) for at, _ in last]
            command = replace(self.decision.command, twist=twist)
            self.decision = replace(self.decision, command=command)

    def acting(self) -> Array:
        """The twists (n, 6) for each tick from the last picture to the next one."""
        twists = np.array([self._in_force(self._now + tick) for tick in self._ticks])
        self._asked = mean_twist(twists)
        return twists

    def _transport(self) -> float:
        longest = self._run.jitter_ms
        return 1e-3 * float(self._rng.uniform(0.0, longest)) if longest else 0.0

    def _goes_on(self, end: float) -> bool:
        """Let the tracker finish a picture, or take one; whether either was before `end`."""
        work = self._work
        if work is not None:
            if work.done < end:
                self._decide(work)
                self._work = None
                self._free = work.done
            return self._work is None
        begin = max(self._free, self._coming[0][0]) if self._coming else end
        if begin < end:
            self._work = self._begin(begin)
        return self._work is not None

    def _begin(self, begin: float) -> _Work:
        """Take the newest picture that has arrived by a time, or the last dropped frame."""
        arrived = [taken for at, taken in self._coming if at <= begin + SAME]
        del self._coming[: len(arrived)]
        pictures = [taken for taken in arrived if taken.frame.fresh]
        taken = pictures[-1] if pictures else arrived[-1]
        posture = taken.posture if self._plain else self._record.paired(taken.frame.index)
        is_first = self._is_first
        self._is_first = False
        self._loop.track(taken.frame, posture)
        track, law = self.seconds
        self.seconds = track + self._loop.seconds[0], law
        self._skipped += max(0, len(pictures) - 1)
        takes = self._run.tracker_ms
        lasts = self._loop.seconds[0] if isinstance(takes, str) else 1e-3 * takes
        at_once = is_first or not pictures  # the first state is given
        return _Work(taken, posture, begin + (0.0 if at_once else lasts))

    def _decide(self, work: _Work) -> None:
        loop = self._loop
        taken = work.taken
        posture = work.posture
        acts = self._tick_after(work.done + self._run.latency * self._period)
        while len(self._commands) > 1 and self._commands[1][0] <= taken.frame.time + SAME:
            del self._commands[0]
        if not self._plain:
            posture = replace(posture, under_way=self._under_way(taken.frame.time, acts))
        truth = None
        if loop.needs_truth:
            truth = self._motion_true(taken.truth, acts, acts + loop.interval)
        command = loop.decide(posture, truth)
        track, law = self.seconds
        self.seconds = track, law + loop.seconds[1]
        self._commands.append((acts, command.twist))
        self._decided += 1
        age = work.done - taken.frame.time
        self.decision = Decision(taken.truth, command, age, self._skipped)

    def _tick_after(self, time: float) -> float:
        """The first update of the drives at a time [s] or after it."""
        frame = int((time + SAME) // self._period)
        at = frame * self._period
        later = self._ticks[self._ticks >= time - at - SAME]
        return at + float(later[0]) if len(later) else (frame + 1) * self._period

    def _in_force(self, time: float) -> Array:
        """The twist (6,) that acts at a time [s]."""
        return next(twist for at, twist in reversed(self._commands) if at <= time + SAME)

    def _under_way(self, begin: float, end: float) -> tuple[tuple[Array, float], ...]:
        """The twists (6,) that act between two times, and how long each [s]."""
        starts = [max(at, begin) for at, _ in self._commands]
        stops = [*starts[1:], end]
        pieces = zip(self._commands, starts, stops, strict=True)
        return tuple((c[1], min(b, end) - a) for c, a, b in pieces if min(b, end) - a > SAME)
