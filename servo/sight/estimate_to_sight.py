"""From a tracker's estimate to what a controller sees: moments, and the plane they lie in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Le

from servo.sight import shape_moments
from servo.sight.plane_fit import PlaneFit
from servo.sight.planes import FACING, level_plane, plane_of_depth, plane_of_size
from servo.types import Moments, Plane, Sight
from sim.geometry import exp_se3
from sim.types import Array, Camera, Posture
from tracking.types import Estimate, Region, State, Status


@dataclass(frozen=True, slots=True)
class SightConfig:
    """What is known of the target's plane."""

    plane: Literal["parallel", "known", "estimated"] = "parallel"
    """Normal of the target's plane: "parallel" to the image, "known" from the robot's posture (the
    table is level), or "estimated" from where the target has been seen to drive."""
    depth: Literal["size", "known"] = "size"
    """Depth of the target, for the interaction matrix: from its metric "size" and its area in the
    image, or "known" from the robot's posture and table_height."""
    depth_factor: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """The depth that the matrix is computed with, over the right one: the gain of translations is
    wrong by the same factor."""
    table_height: Annotated[float, Ge(-5), Le(5)] = 0.0
    """Height of the table over the robot's base [m]."""


@final
class EstimateToSight:
    """Knows the camera, the template and the target's metric size."""

    def __init__(self, config: SightConfig, camera: Camera, region: Region, outline: Array) -> None:
        """Begin a run.

        Args:
            config: Where plane and depth come from.
            camera: Intrinsics.
            region: The template.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
        """
        self._config, self._camera, self._region = config, camera, region
        self._root_area = float(np.sqrt(np.prod(np.ptp(outline[:, :2], axis=0))))
        self._height = config.table_height + float(outline[0, 2])
        self._fit = PlaneFit()
        self._plane: Plane | None = None

    def see(self, estimate: Estimate, posture: Posture) -> Sight | None:
        """The sight of an estimate; None where the tracker does not see the target."""
        if estimate.status is not Status.LOCKED:
            return None
        m = shape_moments.of_state(estimate.state, self._region, self._camera)
        self._plane = self._plane_at(m, posture)
        angle, size = estimate.follows
        return Sight(m, self._plane, angle_known=angle, size_known=size)

    def goal(self, state: State, region: Region) -> Sight:
        """How the target shall be seen: from straight above, where a state places a region."""
        m = shape_moments.of_state(state, region, self._camera)
        return Sight(m, self._scaled(plane_of_size(m, self._root_area, FACING)))

    def ego(self, state: State, twist: Array, dt: float) -> Array:
        """How a camera twist (6,) over a time [s] has moved a target that stood still: change (4,)
        of (x, y, theta, ln scale).

        Its centre and the front of its rectangle are taken for points of its plane.
        """
        if self._plane is None:
            return np.zeros(4)
        front = self._region.corners(state)[1:3].mean(axis=0)
        before = np.stack([[state.x, state.y], front])
        rays = np.column_stack([self._camera.normalise(before), np.ones(2)])
        points = rays / (rays @ self._plane.vector)[:, None]
        after = self._camera.project(exp_se3(twist * dt).inverse().apply(points))
        arm = [complex(*(ends[1] - ends[0])) for ends in (before, after)]
        turned = np.log(arm[1] / arm[0])
        return np.array([*(after[0] - before[0]), turned.imag, turned.real])

    def _plane_at(self, m: Moments, posture: Posture) -> Plane:
        c = self._config
        normal, ray = self._normal(posture), np.array([m.xg, m.yg, 1.0])
        if c.depth == "known":
            depth = 1 / float(level_plane(posture.T_base_camera, self._height).vector @ ray)
            plane = plane_of_depth(m, depth, normal)
        else:
            plane = plane_of_size(m, self._root_area, normal)
        if c.plane == "estimated":
            self._fit.add(posture.T_base_camera, ray / float(plane.vector @ ray))
        return self._scaled(plane)

    def _normal(self, posture: Posture) -> Array:
        match self._config.plane:
            case "parallel":
                return FACING
            case "known":
                return level_plane(posture.T_base_camera, self._height).vector
            case "estimated":
                return self._fit.normal(posture.T_base_camera)

    def _scaled(self, plane: Plane) -> Plane:
        """The plane that the interaction matrix is computed with."""
        f = self._config.depth_factor
        return plane if f == 1.0 else Plane(plane.A / f, plane.B / f, plane.C / f)
