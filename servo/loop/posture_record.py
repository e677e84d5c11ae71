"""Record of the robot's postures: it returns, for each picture that the tracker takes, the posture
at that frame, with the camera pose at the time that is stamped on the picture.
"""

from dataclasses import replace
from typing import final

import numpy as np

from sim.geometry import exp_se3, log_se3
from sim.types import Pose, Posture

REGULAR = 1e-6
"""Deviation from a whole number of frame intervals that counts as rounding [frame intervals]."""


def elapsed(last: float, now: float, period: float) -> float:
    """Return the time between two pictures [s]; exactly a whole number of frame intervals if it is
    one up to rounding.

    Args:
        last: Time of the earlier picture [s].
        now: Time of the later picture [s].
        period: Frame interval [s].

    Raises:
        ValueError: The later picture is not later than the earlier one.
    """
    if now <= last:
        raise ValueError(
            f"frame.time: expected a time after that of the frame before, {last} s, got {now} s"
        )
    frames = (now - last) / period
    whole = round(frames)
    return whole * period if abs(frames - whole) < REGULAR else now - last


@final
class PostureRecord:
    """Record of the robot's postures at the times of all frames, which returns the posture for each
    picture that the tracker takes.

    If the clocks of camera and robot differ, the time stamped on a picture is wrong by their
    offset: the picture is then paired with the camera pose at the stamped time.
    """

    def __init__(self, period: float, clock_offset: float) -> None:
        """Create an empty record.

        Args:
            period: Frame interval [s].
            clock_offset: Stamp minus true time of a picture [s].
        """
        self._period = period
        self._offset = clock_offset
        self._postures: dict[int, Posture] = {}
        self._taken: int | None = None
        self._pose: Pose | None = None

    def add(self, index: int, posture: Posture) -> None:
        """Store the robot's posture at a frame.

        Args:
            index: Number of the frame.
            posture: The posture; its `asked` is the mean commanded camera twist since the frame
                before.
        """
        self._postures[index] = posture

    def paired(self, index: int) -> Posture:
        """Return the posture for the picture of a frame, with the camera pose at the time stamped
        on the picture; if this time is before or after all stored frames, with the pose at the
        nearest frame. Measured, accepted and commanded twists are means over the time since the
        frame of the previous call; in the first call they are as stored. Postures that later calls
        do not need are deleted.

        Args:
            index: Number of the frame, higher than in the previous call; its posture must have been
                added.
        """
        posture = self._postures[index]
        last = self._taken
        before = self._pose
        pose = posture.T_base_camera if self._offset == 0 else self._pose_at(index)
        self._taken = index
        self._pose = pose
        # The stamps of later pictures reach back by the offset, so that those frames are kept.
        reach = int(abs(self._offset) / self._period) + 2
        between = [p for i, p in self._postures.items() if last is not None and last < i <= index]
        self._postures = {i: p for i, p in self._postures.items() if i > index - reach}
        if last is None or before is None:
            return replace(posture, T_base_camera=pose)
        if self._offset == 0 and len(between) == 1:
            return posture
        accepted = [p.accepted for p in between if p.accepted is not None]
        asked = [p.asked for p in between if p.asked is not None]
        return replace(
            posture,
            T_base_camera=pose,
            twist=log_se3(before.inverse() @ pose) / (self._period * (index - last)),
            accepted=np.mean(accepted, axis=0) if accepted else None,
            asked=np.mean(asked, axis=0) if asked else None,
        )

    def _pose_at(self, index: int) -> Pose:
        """Return the pose T_base_camera at the stamp of a frame, interpolated between two frames on
        a screw motion; for a stamp outside the stored frames, the pose at the nearest one.
        """
        frames = index + self._offset / self._period
        at = float(np.clip(frames, min(self._postures), max(self._postures)))
        i = int(min(at, max(self._postures) - 1)) if len(self._postures) > 1 else int(at)
        start = self._postures[i].T_base_camera
        if at == i:
            return start
        way = log_se3(start.inverse() @ self._postures[i + 1].T_base_camera)
        return start @ exp_se3(way * (at - i))
