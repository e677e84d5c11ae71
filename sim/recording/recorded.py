"""A recording of a real scene, and its target as a flat target in the simulated room, whose motion
follows from the target's true outlines in the recording.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import atan2
from typing import Protocol, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera.renderer import MakeRenderer
from sim.models.paint import THIN
from sim.models.target import Target, rectangle
from sim.outline import area
from sim.placement import DOWN
from sim.types import Array, Camera, Image, Pose

HEIGHT = 2.0
"""Height of the recording camera above the table, from where it looks straight down [m]."""
EYE = Pose(DOWN, np.array([0.0, 0.0, HEIGHT]))
"""T_world_camera of the recording camera: image u along world x."""
FIRST_DEPTH = 1.0
"""Distance along the optical axis at which the target is in the first picture [m]; a recording does
not show how large things are."""
SAME_TIME = 1e-6
"""A picture counts as taken at a time if it is later by less than this [s]."""

Shown = Iterator[tuple[float, Image | None]]
"""Times [s] and RGB pictures (H, W, 3) in order; None for a picture that cannot be decoded."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording of a real scene: intrinsics of its camera; the times of its n pictures since the
    first [s]; the target's corners in them (n, 4, 2) [px], the first edge along the target's nose,
    nan where the target is absent; and a function that returns an iterator over times and pictures.
    """

    camera: Camera
    """Intrinsics of the recording camera, with its lens."""
    times: Array
    """Time of each picture since the first (n,) [s], ascending."""
    corners: Array
    """The target's corners (n, 4, 2) in each picture [px], from the picture's top left corner: the
    first pixel has its centre at (0.5, 0.5). They are nan where the target is absent; it is there
    in the first picture."""
    pictures: Callable[[], Shown]
    """Function that returns an iterator over the pictures, from the first one."""

    def index(self, time: float) -> int:
        """Return the number (from 0) of the picture that was the newest at a time [s] since the
        first one: 0 for times before it, and the last number for times after the recording.
        """
        number = int(np.searchsorted(self.times, time + SAME_TIME, side="right")) - 1
        return min(max(number, 0), len(self.times) - 1)

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """Mask (n,), true for each picture that shows the target: one in which all its corners are
        finite, and its outline has an area.
        """
        finite = np.isfinite(self.corners).all(axis=(1, 2))
        return finite & np.array([area(corners) > 0 for corners in self.corners])

    @cached_property
    def _rays(self) -> Array:
        """Corners (n, 4, 2) as X/Z, Y/Z in the frame of the recording camera; where the target is
        absent, those of the last picture that shows it.
        """
        last = np.maximum.accumulate(np.where(self.present, np.arange(len(self.times)), 0))
        return self.camera.normalise(self.corners[last])

    def target(self) -> Target:
        """Return a flat target as long and wide as the first and second edge of the target's
        outline in the first picture, if it was 1 m away along the optical axis: a recording does
        not tell the true size.
        """
        first = self._rays[0]
        length, width = np.linalg.norm(first[1:3] - first[:2], axis=1) * FIRST_DEPTH
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[length / 2, width / 2, THIN], pos=[0, 0, -THIN]
        )
        return Target(spec, rectangle(np.zeros(3), float(length), float(width)))

    def motion(self) -> "RecordedMotion":
        """Return the motion T_world_target of the flat target that `target` returns.

        The target stays parallel to the plane of the picture, on the ray through the recorded
        outline's middle, and at the depth at which it covers the outline's area. Its x axis lies
        along the outline's first edge in the first picture, and then turns by the rotation of the
        similarity that takes the first outline to that of each picture. While the target is absent,
        it stays where it was seen last.
        """
        middles = self._rays.mean(axis=1)
        areas = np.array([area(corners) for corners in self._rays])
        first = self._rays[0]
        own = np.prod(np.linalg.norm(first[1:3] - first[:2], axis=1))
        depths = FIRST_DEPTH * np.sqrt(own / areas)
        # As complex numbers: the factor between the centred corners has the rotation as its angle.
        away = (self._rays - middles[:, None]) @ [1, 1j]
        turned = np.angle(away @ away[0].conj()) + atan2(*(first[1] - first[0])[::-1])
        points = np.column_stack([middles, np.ones(len(middles))]) * depths[:, None]
        poses = [
            Pose(Pose.planar(0.0, 0.0, -theta).rotation, EYE.apply(point))
            for point, theta in zip(points, turned.tolist(), strict=True)
        ]
        return RecordedMotion(self, poses)


@final
class RecordedMotion:
    """The motion of the target in a recording, with the method `at` of a `sim.stage.Motion`.
    `poses` holds T_world_target for each picture; between two pictures the target stays where the
    earlier one shows it.
    """

    def __init__(self, recorded: Recorded, poses: list[Pose]) -> None:
        """Store the recording, and T_world_target for each of its pictures."""
        self._recorded = recorded
        self._poses = poses

    def at(self, time: float) -> Pose:
        """Return the target's pose T_world_target at a time since the start of the run [s]."""
        return self._poses[self._recorded.index(time)]


class RecordingSettings(Protocol):
    """Settings of a recording of a real scene, whose pictures take the place of rendered ones if a
    run uses a recording.
    """

    def renderer(self) -> MakeRenderer | None:
        """Return a function that makes the renderer of a camera which turns about the centre of the
        recording camera; None if the run uses no recording. Called when a run is built, before its
        first picture.
        """
        ...

    def remarks(self, focal: float) -> list[str]:
        """Return remarks about the recording that the user is to read, a sentence each; an empty
        list if there are none. `focal` is the focal length of the run's camera [px].
        """
        ...
