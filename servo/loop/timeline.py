"""Simulated times of a run: when a picture arrives, when the tracker takes it, and when the
resulting command acts.

A picture arrives at the tracker up to `run.jitter_ms` after it was taken. A tracker that is not
busy takes the newest picture that has arrived. Its estimate is ready `run.tracker_ms` later, and
pictures that arrive in between are skipped, except for the newest. The first picture, whose
estimate is given, takes the tracker no time. Neither does a frame without a picture, which is used
only if no picture has arrived. The law runs once for each estimate.
Its command acts `run.latency` frame intervals or `run.latency_ms` later, from the next update of
the drives on; until then the robot follows the previous command.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from servo.loop.loop import Decision, Observation, Running
from servo.loop.posture_record import PostureRecord
from servo.loop.settings import RunConfig
from servo.types import Command
from sim.types import Array, Frame, Posture

SAME = 1e-9
"""Largest difference of equal times [s]: they are sums of rounded intervals."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """Times that decide when things happen in a run: the delays of tracker, pictures and commands,
    the frame interval [s], the times (n,) after a frame at which the drives update their command
    [s] and for how long each command holds, and stamped minus true time of a picture [s]; and
    whether twists other than the law's may act.
    """

    run: RunConfig
    """The delays of tracker, pictures and commands."""
    period: float
    """Frame interval [s]."""
    ticks: Array
    """Times (n,) after a frame at which the drives update their command [s]."""
    shares: Array
    """Times (n,) for which these commands hold, over the first of them."""
    clock_offset: float
    """Stamp minus true time of a picture [s]."""
    steered: bool
    """Whether twists other than the law's may act; the law is then told which ones acted."""


@dataclass(frozen=True, slots=True)
class TimedDecision:
    """A decision of the loop (view of the target, command) with the command that acts, the number
    of the picture from which it was made, the time from that picture until its estimate was ready
    [s], and the number of pictures that the tracker has skipped since the run began.
    """

    decision: Decision
    command: Command
    """The command that acts: that of the decision, or one that replaced it."""
    picture: int = 0
    """Number of the picture that the decision is about."""
    age: float = 0.0
    """Time from that picture to its estimate [s]."""
    skipped: int = 0
    """Pictures since the run began that the tracker had no time for."""


@dataclass(frozen=True, slots=True)
class _Arrival:
    """A picture on its way to the tracker, and the time of the run at which it arrives."""

    time: float
    frame: Frame
    posture: Posture


@dataclass(frozen=True, slots=True)
class _Work:
    """The tracker's estimate from a picture that it has taken, and the time of the run at which the
    estimate is ready.
    """

    observation: Observation
    posture: Posture
    done: float
    """Time at which the estimate is ready [s]."""


def mean_twist(twists: Array, shares: Array) -> Array:
    """Return the mean over time (6,) of n twists (n, 6), n >= 1 [m/s, rad/s], that act one after
    the other for times in the ratios of `shares` (n,); exactly that twist, without rounding, if all
    are equal.
    """
    same = (twists == twists[0]).all()
    return twists[0] if same else np.average(twists, axis=0, weights=shares)


@final
class Timeline:
    """Gives the pictures of a run to its loop when they arrive at the tracker, and returns the
    commanded camera twists when they act, both in simulated time.
    """

    def __init__(self, schedule: Schedule, running: Running, rng: np.random.Generator) -> None:
        """Begin a run with a loop that was started.

        Args:
            schedule: Intervals and delays.
            running: The running loop.
            rng: Random generator of the pictures' transport times, for `run.jitter_ms`.
        """
        self._schedule = schedule
        self._ticks: list[float] = schedule.ticks.tolist()
        self._running = running
        self._rng = rng
        run = schedule.run
        on_time = run.tracker_ms == 0 and run.jitter_ms == 0 and schedule.clock_offset == 0
        self._by_frames = on_time and run.latency_ms is None
        # Then each posture of the robot already belongs to its picture and to one command.
        self._plain = self._by_frames and not schedule.steered
        self._record = PostureRecord(schedule.period, schedule.clock_offset)
        self._now = 0.0
        """Time of the last picture [s]."""
        self._arrival = 0.0
        """Time at which the last picture arrives [s]; later ones do not overtake it."""
        self._coming: list[_Arrival] = []
        """Pictures that the tracker has not taken yet."""
        self._work: _Work | None = None
        """The picture that the tracker is working on."""
        self._free = 0.0
        """Time at which the tracker finished the previous picture [s]."""
        self._skipped = 0
        self.decided = 0
        """Number of decisions since the last picture."""
        self._is_first = True
        self.latest = TimedDecision(running.decision, running.decision.command)
        """The last decision."""
        self.track_seconds = 0.0
        """Wall-clock time of the tracker in the last frame interval [s]."""
        self.law_seconds = 0.0
        """Wall-clock time of the law in the last frame interval [s]."""
        self._asked = np.zeros(6)
        """Mean twist (6,) asked for since the last picture."""
        # With a latency of whole frames, one zero command for each frame until the first acts: the
        # law counts its pending commands the same way.
        first = range(max(1, run.latency) if self._by_frames else 1)
        self._commands = [(frame * schedule.period, np.zeros(6)) for frame in first]
        """When each command begins to act [s], and its twist (6,), in order."""

    def advance(self, frame: Frame, posture: Posture) -> None:
        """Run tracker and law over the frame interval that begins with a frame, the next one of the
        run. Afterwards `latest` is the last decision, and `decided` the number of decisions in this
        interval.

        Args:
            frame: The frame, with its picture.
            posture: Pose, twist and joints that the robot measured at the time of the frame.
        """
        self._now = frame.time
        end = self._now + self._schedule.period - SAME
        self.decided = 0
        self.track_seconds = 0.0
        self.law_seconds = 0.0
        if not self._plain:
            self._record.add(frame.index, posture.commanded(self._asked))
        # Transport takes a random time, but pictures arrive in their order.
        self._arrival = max(self._arrival, self._now + self._transport())
        self._coming.append(_Arrival(self._arrival, frame, posture))
        while (estimated := self._estimated_before(end)) is not None:
            self._decide(estimated)
            self._work = None
            self._free = estimated.done

    def steer(self, twist: Array) -> None:
        """Replace the commands that the law computed since the last picture by another one, which
        acts at the same times; do nothing if it computed none.

        Args:
            twist: The other camera twist (6,) in the camera frame [m/s, rad/s].
        """
        if self.decided:
            # They keep the times at which they act; what acted before them stays.
            last = self._commands[-self.decided :]
            self._commands[-self.decided :] = [(at, twist) for at, _ in last]
            now = self.latest
            command = replace(now.command, twist=twist)
            self.latest = TimedDecision(now.decision, command, now.picture, now.age, now.skipped)

    @property
    def is_known_ahead(self) -> bool:
        """Whether the commands that act until the next picture are known before the law computes
        one from the present picture: with a latency of at least one frame interval, no other delay,
        and only commands of the law.
        """
        return self._plain and self._schedule.run.latency >= 1

    def acting(self, later: int = 0) -> Array:
        """Return the commanded camera twists (n, 6) in the camera frame [m/s, rad/s] that act in
        one frame interval, one for each of the n updates of the drives in it, and store their mean
        as the commanded twist of the posture that `advance` is given next.

        Args:
            later: 0 for the frame interval that begins with the last picture, 1 for the one after
                it.
        """
        begin = self._now + later * self._schedule.period
        twists = np.array([self._in_force(begin + tick) for tick in self._ticks])
        self._asked = mean_twist(twists, self._schedule.shares)
        return twists

    def _transport(self) -> float:
        longest = self._schedule.run.jitter_ms
        return 1e-3 * float(self._rng.uniform(0.0, longest)) if longest else 0.0

    def _estimated_before(self, end: float) -> _Work | None:
        """Return the tracker's estimate with its picture's data if it is ready before a time of the
        run [s], else None. A tracker that is not busy first takes a picture, if one arrives before
        that time.
        """
        # A picture may be taken in an earlier frame interval than that in which it is finished.
        if self._work is None and self._coming:
            begin = max(self._free, self._coming[0].time)
            if begin < end:
                self._work = self._begin(begin)
        return self._work if self._work is not None and self._work.done < end else None

    def _begin(self, begin: float) -> _Work:
        """Let the tracker take the newest picture that has arrived by a time of the run [s], or, if
        only frames without a picture have arrived, the last of these; return its estimate.
        """
        arrived = [picture for picture in self._coming if picture.time <= begin + SAME]
        del self._coming[: len(arrived)]
        # Dropped frames carry no picture: one counts only if nothing else has arrived.
        pictures = [picture for picture in arrived if picture.frame.fresh]
        newest = pictures[-1] if pictures else arrived[-1]
        frame = newest.frame
        # The record averages the robot's motion over the pictures that the tracker skipped.
        posture = newest.posture if self._plain else self._record.paired(frame.index)
        is_first = self._is_first
        self._is_first = False
        observation = self._running.track(frame, posture)
        self.track_seconds += observation.seconds
        self._skipped += max(0, len(pictures) - 1)
        takes = self._schedule.run.tracker_ms
        lasts = observation.seconds if isinstance(takes, str) else 1e-3 * takes
        at_once = is_first or not pictures  # the first estimate is the given state
        return _Work(observation, posture, begin + (0.0 if at_once else lasts))

    def _decide(self, work: _Work) -> None:
        schedule = self._schedule
        frame = work.observation.frame
        posture = work.posture
        acts = self._tick_after(
            work.done + schedule.run.frames_late(schedule.period) * schedule.period
        )
        # Commands that were replaced before this picture act no more.
        while len(self._commands) > 1 and self._commands[1][0] <= frame.time + SAME:
            del self._commands[0]
        if not self._plain:
            posture = posture.commanded(posture.asked, self._under_way(frame.time, acts))
        decision = self._running.decide(work.observation, posture, acts)
        self.law_seconds += decision.seconds
        self._commands.append((acts, decision.command.twist))
        self.decided += 1
        age = work.done - frame.time
        self.latest = TimedDecision(decision, decision.command, frame.index, age, self._skipped)

    def _tick_after(self, time: float) -> float:
        """Return the time of the first update of the drives that is not before a time of the run
        [s].
        """
        period = self._schedule.period
        ticks = self._schedule.ticks
        # The updates of the drives have the same times in each frame interval.
        frame = int((time + SAME) // period)
        at = frame * period
        later = ticks[ticks >= time - at - SAME]
        return at + float(later[0]) if len(later) else (frame + 1) * period

    def _in_force(self, time: float) -> Array:
        """Return the commanded camera twist (6,) [m/s, rad/s] that acts at a time of the run
        [s].
        """
        for at, twist in reversed(self._commands):
            if at <= time + SAME:
                return twist
        raise ValueError(f"no command acts at {time} s")  # the first acts from time 0 on

    def _under_way(self, begin: float, end: float) -> tuple[tuple[Array, float], ...]:
        """Return the commanded twists (6,) [m/s, rad/s] that act between two times of the run [s],
        each with its duration [s].
        """
        # Each command acts until the next one begins, the last one until the end.
        starts = [max(at, begin) for at, _ in self._commands]
        stops = [*starts[1:], end]
        pieces = zip(self._commands, starts, stops, strict=True)
        found = tuple((c[1], min(b, end) - a) for c, a, b in pieces if min(b, end) - a > SAME)
        if self._by_frames:  # each acts for a frame, but for the rounding of times
            return tuple((twist, self._schedule.period) for twist, _ in found)
        return found
