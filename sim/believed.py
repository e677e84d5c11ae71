"""Errors of calibration: the camera, joints and goal as the robot believes them."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from sim.geometry import exp_so3
from sim.ranges import Degrees, EachJoint
from sim.types import Camera, Pose

Shift = Annotated[float, Ge(-10_000), Le(10_000)]
Millimetres = Annotated[float, Ge(-1000), Le(1000)]


@dataclass(frozen=True, slots=True)
class BelievedConfig:
    """Errors of calibration; by default there are none."""

    fx_factor: Annotated[float, Ge(0.1), Le(10)] = 1.0
    """Believed over true focal length, along u and v."""
    cx_shift: Shift = 0.0
    """The principal point is believed this far to the right of the true one [px]."""
    cy_shift: Shift = 0.0
    """The principal point is believed this far below the true one [px]."""
    ignore_distortion: bool = False
    """The camera is taken for a pinhole."""
    goal: Literal["computed", "shown", "pose"] = "computed"
    """How the goal is known: "computed", its centre in pixels, its size from the believed camera;
    "shown", the corners that the true camera sees at the true goal; or "pose", the target's pose in
    the camera at the true goal [m]."""
    hand_eye_rotation_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)
    """Orientation of the believed camera in the true one (x right, y down, z forward), a rotation
    vector [deg]."""
    hand_eye_mm: tuple[Millimetres, Millimetres, Millimetres] = (0.0, 0.0, 0.0)
    """Position of the believed camera in the true one [mm]."""
    joint_offsets: EachJoint = 0.0
    """Believed minus true joint positions, one for all or one each [m or rad]."""
    clock_offset_ms: Annotated[float, Ge(-60_000), Le(60_000)] = 0.0
    """A picture's time stamp minus its true time [ms]: the robot pairs the picture with where it
    was at the stamp, or with its newest posture."""
    depth_factor: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """The depth that the matrix of moments, points and segments is computed with, over the right
    one: the gain of translations is wrong by the same factor."""

    def camera(self, camera: Camera) -> Camera:
        """Return the believed camera; the same object where nothing of it is wrong."""
        f = self.fx_factor
        lens = None if self.ignore_distortion else camera.distortion
        believed = replace(
            camera,
            fx=camera.fx * f,
            fy=camera.fy * f,
            cx=camera.cx + self.cx_shift,
            cy=camera.cy + self.cy_shift,
            distortion=lens,
        )
        return camera if believed == camera else believed

    @property
    def hand_eye(self) -> Pose:
        """Return T_camera_believed."""
        turn = exp_so3(np.radians(self.hand_eye_rotation_deg))
        return Pose(turn, np.array(self.hand_eye_mm) / 1e3)

    @property
    def is_body_right(self) -> bool:
        """True where neither the camera's mount nor the joints are believed wrongly."""
        errors = *self.hand_eye_rotation_deg, *self.hand_eye_mm, *np.ravel(self.joint_offsets)
        return not any(errors)


RIGHT = BelievedConfig()
"""Nothing is wrong."""
