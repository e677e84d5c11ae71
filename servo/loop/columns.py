"""Numbers of a run's steps as columns (one array for each number, one row for each step, that is,
for each frame), from which measures and time series are computed.

A whole step takes 7 kB, its numbers 400 bytes, so that long runs fit into memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servo.loop.step import Step
from servo.sight.certainty import certain
from sim.mounting import CAMERA
from sim.types import Array
from tracking.types import Status

FINAL_SPAN = 1.0
"""Length of the end of a run that decides its outcome [s]."""
ROOM = 0
"""Number of the body in MuJoCo that never moves, the world."""


class Columns:
    """Numbers of all steps of a run so far (a step is one frame), as columns: `columns[name]` is an
    array (n, ...) with one row for each of n steps, for a name of `NUMBERS`. They also hold some
    whole steps, without pictures: the first one (`first`), those of the last second (`final`), and
    the last second of those whose tracker status was not LOST (`followed`).
    """

    first: Step
    """The first step, without its picture."""

    def __init__(self) -> None:
        """Create columns without rows."""
        self._rows = bytearray()
        self.final = deque[Step]()
        """The steps of the last `FINAL_SPAN` seconds, without pictures."""
        self.followed = deque[Step]()
        """The last steps with a target that was not LOST, over `FINAL_SPAN` seconds."""

    @staticmethod
    def of(steps: Columns | Iterable[Step]) -> Columns:
        """Return the columns of a run, computed from its steps; if `steps` are columns already,
        return the same object.
        """
        if isinstance(steps, Columns):
            return steps
        found = Columns()
        for step in steps:
            found.add(step)
        return found

    def __len__(self) -> int:
        return len(self._rows) // self._kind.itemsize if self._rows else 0

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, an array (n, ...) with one row for each of the n steps so far; steps
        that are added later do not change it.

        Args:
            name: A key of `NUMBERS`, or "other_picture": True for the steps whose `Step.picture` is
                another than that of the step before.
        """
        return np.frombuffer(self._rows, self._kind)[name]

    def add(self, step: Step) -> None:
        """Append the numbers of a step, the next one of the run, as a row, and update `first`,
        `final` and `followed`, which hold whole steps without pictures.
        """
        row = {name: np.asarray(of(step)) for name, of in NUMBERS.items()}
        last = self.final[-1] if self.final else step
        row["other_picture"] = np.asarray(step.truth_estimated is not last.truth_estimated)
        if not self._rows:
            self.first = step.light()
            self._kind = np.dtype([(name, _kind(each), each.shape) for name, each in row.items()])
        numbers = np.array(tuple(row.values()), self._kind).tobytes()
        try:
            self._rows += numbers
        except BufferError:  # somebody holds a column, a view of this memory
            self._rows = self._rows + numbers
        # Pictures and particles are left out: they are most of a step's memory.
        light = step.light()
        _append(self.final, light)
        if step.estimate.status is not Status.LOST:
            _append(self.followed, light)


def _append(steps: deque[Step], step: Step) -> None:
    """Append a step to a queue, and remove the steps at its beginning that are `FINAL_SPAN` or more
    older.
    """
    steps.append(step)
    while steps[0].frame.time <= step.frame.time - FINAL_SPAN:
        steps.popleft()


def _kind(value: NDArray[np.generic]) -> type[bool] | type[float]:
    return bool if value.dtype == np.bool_ else float


def _carried(step: Step) -> Array:
    """Return the position (3,) in the world frame [m] of what the robot carries: the camera; or the
    target, if the camera stands.
    """
    stands = step.scene.room.camera(CAMERA).bodyid == ROOM
    truth = step.truth
    return (truth.T_world_target if stands else truth.T_world_camera).translation


def _tracking_angle(step: Step) -> float:
    """Return the estimated minus the true angle of the target [rad], wrapped to -pi to pi: a
    tracker that confuses front and back is wrong by pi.
    """
    return float(np.angle(np.exp(1j * (step.estimate.state.theta - step.truth_estimated.theta))))


def _range_used(step: Step) -> float:
    """Return the largest distance of a joint with two limits from its mid-range, over half its
    range: 0 (middle) to 1 (limit), above 1 beyond a limit; 0 if no joint has two limits.
    """
    p = step.posture
    limited = np.isfinite(p.lower) & np.isfinite(p.upper)
    half = (p.upper[limited] - p.lower[limited]) / 2
    return float(np.max(1 - step.margins[limited] / half, initial=0.0))


def _out_of_view(step: Step) -> bool:
    camera = step.scene.camera
    corners = step.truth.corners
    T_camera_target = step.truth.T_world_camera.inverse() @ step.truth.T_world_target
    # The projection of a corner behind the camera may lie inside the picture.
    if (T_camera_target.apply(step.scene.outline)[:, 2] <= 0).any():
        return True
    return bool(((corners < 0) | (corners > (camera.width, camera.height))).any())


def _seconds(step: Step) -> tuple[float, ...]:
    s = step.seconds
    return s.render, s.track, s.control, s.physics


NUMBERS: dict[str, Callable[[Step], object]] = {
    "time": lambda s: s.frame.time,
    "servo": lambda s: s.servo_error if s.truth.depth > 0 else np.inf,
    "fresh": lambda s: s.frame.fresh,
    "picture": lambda s: s.picture - s.frame.index,
    "turned": lambda s: s.truth.theta - s.goal.theta,
    "size": lambda s: s.truth.size,
    "goal_size": lambda s: s.goal.size,
    "tracking": lambda s: s.tracking_error,
    "tracking_angle": _tracking_angle,
    "tracking_scale": lambda s: s.estimate.state.scale / s.true_state_estimated.scale,
    "tilt": lambda s: s.tilt,
    "range_used": _range_used,
    "joints": lambda s: s.posture.joints,
    "age": lambda s: s.age,
    "camera": lambda s: s.T_object_camera.translation,
    "orientation": lambda s: s.T_object_camera.rotation,
    "carried": _carried,
    "corners": lambda s: s.truth.corners,
    "command": lambda s: s.command.twist,
    "seconds": _seconds,
    "decided": lambda s: s.decided,
    "tracked": lambda s: s.tracked,
    "size_followed": lambda s: s.estimate.follows[1] or s.estimate.corners is not None,
    "size_refused": lambda s: s.estimate.likely_scale is not None,
    "uncertain": lambda s: np.logical_not(certain(s.estimate, s.region)),
    "saturated": lambda s: s.limited or s.command.saturated,
    "seen": lambda s: s.seen,
    "lost": lambda s: s.estimate.status is Status.LOST,
    "out_of_view": _out_of_view,
}
"""Functions that compute the columns from a step, by name; units are those of `Step`."""
