"""Other trackers on the recording of a closed loop: would they have held, and for how long would
the recorded pictures have been the same?

A law that keeps the estimated target at its goal moves the picture, within the time that its gain
needs, by as much as two estimates differ. So the pictures of a loop with another tracker would have
been the recorded ones until its estimate was away from the recorded one for that time, whatever the
law. (Comparing the commands of the law was tried: differences of the smoothed twists and of the
estimator make noise of 3/4 of the motion itself.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np
import pyarrow as pa

from servo.identify.log import numbers_in
from servo.report.words import Badge, Cell, Table
from sim.types import Array
from tracking.drawing.colours import CURVES
from tracking.drawing.figures import Drawing, panels
from tracking.evaluation.track import Shot, Track
from tracking.types import Region, State, Status

CENTRE = "estimated_x_px", "estimated_y_px"
TURN = "estimated_theta_rad"
SCALE = "estimated_scale"
LONG = 0.5
"""Time over which differences are averaged: that of a usual gain [s]."""
USUAL = 0.95
"""Share of the pictures in which the displacement by the recorded run's own tracker is at most what
counts as noise."""
LOUD = 2.0
"""The pictures count as the same up to so many times the noise."""
SMALL, FAR = 0.1, 0.5
"""Whatever the noise, pictures count as the same below the first of these displacements, and never
above the second [target sizes]."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """A tracker's estimates in the n pictures of a recording."""

    name: str
    times: Array
    """Times of the pictures, the first is 0 (n,) [s]."""
    states: Array
    """x, y [px], theta [rad] and scale of the target (n, 4)."""
    statuses: list[Status]

    @staticmethod
    def of(name: str, shots: list[Shot], target: Region) -> "Tracked":
        """Return the estimates of a tracker from its results for each picture.

        Args:
            name: Name of the tracker.
            shots: The results.
            target: Size of the target in the first picture [px].
        """
        times = np.array([shot.picture.time for shot in shots])
        statuses = [shot.estimate.status for shot in shots]
        return Tracked(name, times - times[0], Track.of(shots, target).states, statuses)


def recorded(table: pa.Table, path: Path, times: Array) -> Array | None:
    """Return the target's states (n, 4) at some times (n,) on the log's clock [s] as the recorded
    run estimated them: x, y [px], theta [rad] and scale; nan outside the log's time, and for what
    the log lacks. None if the log has no columns estimated_x_px and estimated_y_px, or no numbers
    in them at any of these times.

    Raises:
        Mistake: The log has no column time_s, or one of these columns is not one of numbers.
    """
    if not set(CENTRE) <= set(table.column_names):
        return None
    known = numbers_in(table, "time_s", path)
    rows = np.arange(len(known))
    if {"frame", "picture"} <= set(table.column_names):
        # In a run's log a row's estimate may be of an older picture than the row's own.
        pictures, rows = np.unique(numbers_in(table, "picture", path), return_index=True)
        known = np.interp(pictures, numbers_in(table, "frame", path), known)
    columns: list[Array] = []
    for name in (*CENTRE, TURN, SCALE):
        has = name in table.column_names
        values = numbers_in(table, name, path)[rows] if has else np.full(len(known), np.nan)
        if name == TURN:  # a log's angles may jump from pi to -pi
            there = np.isfinite(values)
            values = values.copy()
            values[there] = np.unwrap(values[there])
        columns.append(np.interp(times, known, values, np.nan, np.nan))
    states = np.stack(columns, axis=1)
    return states if np.isfinite(states[:, :2]).all(axis=1).any() else None


@dataclass(frozen=True, slots=True)
class Answers:
    """Trackers on a recording (`found`), beside the states of the target that the recorded run
    estimated (n, 4): x, y [px], theta [rad], scale; and what its own tracker estimates now (`own`,
    None: unknown). `target` is the target's size in the first picture [px].
    """

    target: Region
    recorded: Array
    own: Tracked | None
    found: Sequence[Tracked]

    @property
    def limit(self) -> float:
        """Displacement of the target's corners up to which pictures count as the same [px]."""
        size = SMALL * float(np.sqrt(self.target.width * self.target.height))
        if self.own is None:
            return size
        noise = np.nanquantile(self.displaced(self.own), USUAL)
        return float(np.clip(LOUD * noise, size, FAR / SMALL * size))

    def displaced(self, found: Tracked) -> Array:
        """Return how far the picture would have been displaced by a tracker in place of the
        recorded run's (n,) [px]: the corner of the target that is farthest from the recorded one,
        in the mean of 0.5 s; nan where nothing is recorded.
        """
        there = self.recorded.copy()
        # Where the log lacks theta or scale, they do not differ.
        there[:, 2:] = np.where(np.isnan(there[:, 2:]), found.states[:, 2:], there[:, 2:])
        away = self._corners(found.states) - self._corners(there)
        unknown = np.isnan(there[:, 0])
        away[unknown] = 0.0
        few = max(1, round(LONG / float(np.median(np.diff(found.times)))))
        sums = np.cumsum(np.concatenate([np.zeros((few, 4, 2)), away]), axis=0)
        means = (sums[few:] - sums[:-few]) / few
        return np.where(unknown, np.nan, np.linalg.norm(means, axis=2).max(axis=1))

    def _corners(self, states: Array) -> Array:
        """Return the target's corners (n, 4, 2) of states (n, 4) [px]."""
        return np.stack([self.target.corners(State(*state)) for state in states.tolist()])

    @property
    def sentence(self) -> str:
        """A sentence that says up to which displacement pictures count as the same, and why."""
        return (
            f"the same: the target's corners are displaced by less than {self.limit:.1f} px in the "
            f"mean of {LONG:g} s. A law that keeps the estimated target at its goal moves the "
            "picture by as much as two estimates differ; from there on the recording does not show "
            "what the tracker would have seen"
        )

    @property
    def table(self) -> Table:
        """A table with a row for each tracker: whether it would have held; for how long the
        recorded pictures would have been the same; and, in these, how often it was LOST or UNSURE,
        and the largest displacement [px].
        """
        head = ("tracker", "", "the same pictures", "LOST in them", "UNSURE", "displaced, at most")
        every = [*filter(None, (self.own,)), *self.found]
        return Table(head, [self._row(each) for each in every], (0, 1, 2))

    def _row(self, found: Tracked) -> list[Cell]:
        displaced = self.displaced(found)
        count = len(displaced)
        parts = np.flatnonzero(displaced > self.limit)
        end = int(parts[0]) if len(parts) else count
        lost, unsure = (found.statuses[:end].count(x) for x in (Status.LOST, Status.UNSURE))
        same = "all" if end == count else f"{end} of {count}: until {found.times[end]:.2f} s"
        badge = Badge.of(end == count and not lost, "held", "lost" if lost else "another way")
        most = f"{np.nanmax(displaced[:end], initial=0.0):.1f} px"
        return [found.name, badge, same, str(lost), str(unsure), most]

    def drawing(self) -> Drawing:
        """Return a drawing of the displacement by each tracker over time [px], with the limit."""
        figure, (ax,) = panels(9.0, 3.2)
        every = [*filter(None, (self.own,)), *self.found]
        for found, colour in zip(every, cycle(CURVES), strict=False):
            ax.plot(found.times, self.displaced(found), color=colour, lw=1.2, label=found.name)
        ax.axhline(self.limit, color="black", ls=":", lw=1.0, label="limit")
        ax.set_xlabel("time of the film [s]")
        ax.set_ylabel("displaced [px]")
        ax.legend(fontsize=8, loc="upper left")
        return figure
