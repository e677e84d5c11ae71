"""The numbers of a run's steps from which its measures and series are made, in columns.

A step with all its parts takes 7 kB, its numbers 400 bytes: a run may be long.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import astuple
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servo.loop.step import Step
from servo.sight.certainty import certain
from sim.mounting import CAMERA
from tracking.types import Status

FINAL_SPAN = 1.0
"""The outcome is decided by this last part of a run [s]."""
ROOM = 0
"""The body of MuJoCo's models that never moves."""


class Columns:
    """The numbers of the steps so far, and whole steps where one is not enough to say it in
    numbers: the first one, and those at the end.
    """

    first: Step
    """Without its picture, as the others."""

    def __init__(self) -> None:
        """Begin without a step."""
        self._rows = bytearray()
        self.final = deque[Step]()
        """Those of the last `FINAL_SPAN`."""
        self.followed = deque[Step]()
        """The same of the steps in which the target was not LOST."""

    @staticmethod
    def of(steps: Columns | Iterable[Step]) -> Columns:
        """Return the columns of all steps of a run, if these are not columns already."""
        if isinstance(steps, Columns):
            return steps
        found = Columns()
        for step in steps:
            found.add(step)
        return found

    def __len__(self) -> int:
        return len(self._rows) // self._kind.itemsize if self._rows else 0

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column (n, ...) of `NUMBERS`, or "other_picture": whether the estimate is of
        another picture than that of the step before.
        """
        return np.frombuffer(self._rows, self._kind)[name]

    def add(self, step: Step) -> None:
        """Append the numbers of a step."""
        row = {name: np.asarray(of(step)) for name, of in NUMBERS.items()}
        last = self.final[-1] if self.final else step
        row["other_picture"] = np.asarray(step.truth_estimated is not last.truth_estimated)
        if not self._rows:
            self.first = step.light()
            self._kind = np.dtype([(name, _kind(each), each.shape) for name, each in row.items()])
        self._rows += np.array(tuple(row.values()), self._kind).tobytes()
        light = step.light()
        _append(self.final, light)
        if step.estimate.status is not Status.LOST:
            _append(self.followed, light)


def _append(steps: deque[Step], step: Step) -> None:
    """Append a step, and let go of those that are older than `FINAL_SPAN`."""
    steps.append(step)
    while steps[0].frame.time <= step.frame.time - FINAL_SPAN:
        steps.popleft()


def _kind(value: NDArray[Any]) -> type[bool] | type[float]:
    return bool if value.dtype == np.bool_ else float


def _carried(step: Step) -> NDArray[Any]:
    """Return the place in the room (3,) of what the robot carries: the camera, or the target before
    a camera that stands [m].
    """
    stands = step.scene.room.camera(CAMERA).bodyid == ROOM
    truth = step.truth
    return (truth.T_world_target if stands else truth.T_world_camera).translation


def _tracking_angle(step: Step) -> float:
    """Return the estimated angle against the true one [rad], over the full turn: a tracker that
    takes front for back is wrong by pi.
    """
    return float(np.angle(np.exp(1j * (step.estimate.state.theta - step.truth_estimated.theta))))


def _range_used(step: Step) -> float:
    """Return how far the joint nearest to a limit is from the middle of its range, over half of
    that.
    """
    p = step.posture
    limited = np.isfinite(p.lower) & np.isfinite(p.upper)
    half = (p.upper[limited] - p.lower[limited]) / 2
    return float(np.max(1 - step.margins[limited] / half, initial=0.0))


def _out_of_view(step: Step) -> bool:
    camera = step.scene.camera
    corners = step.truth.corners
    return bool(((corners < 0) | (corners > (camera.width, camera.height))).any())


NUMBERS: dict[str, Callable[[Step], Any]] = {
    "time": lambda s: s.frame.time,
    "servo": lambda s: s.servo_error,
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
    "carried": _carried,
    "corners": lambda s: s.truth.corners,
    "command": lambda s: s.command.twist,
    "seconds": lambda s: astuple(s.seconds),
    "decided": lambda s: s.decided,
    "tracked": lambda s: s.tracked,
    "uncertain": lambda s: np.logical_not(certain(s.estimate, s.region)),
    "saturated": lambda s: s.limited or s.command.saturated,
    "seen": lambda s: s.seen,
    "lost": lambda s: s.estimate.status is Status.LOST,
    "out_of_view": _out_of_view,
}
"""What is kept of a step, by name; units are those of `Step`."""
