"""From a tracker's estimate to what a controller sees: moments, and the plane they lie in."""

from __future__ import annotations

from typing import final

import numpy as np

from servo import features
from servo.interaction import oriented
from servo.plane_fit import PlaneFit
from servo.settings import FeaturesConfig
from servo.types import Moments, Plane, Sight
from sim.geometry import exp_se3
from sim.types import Array, Camera, Posture, Truth
from tracking.types import Estimate, Region, State, Status

FACING = np.array([0.0, 0.0, 1.0])


@final
class Eyes:
    """Knows the camera, the template and the target's metric size."""

    def __init__(
        self, config: FeaturesConfig, camera: Camera, region: Region, outline: Array
    ) -> None:
        """Begin a run.

        Args:
            config: Where plane and depth come from.
            camera: Intrinsics.
            region: The template.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
        """
        self._config, self._camera, self._region = config, camera, region
        self._root_area = float(np.sqrt(np.prod(np.ptp(outline[:, :2], axis=0))))
        self._height = float(outline[0, 2])
        self._fit = PlaneFit()
        self._plane: Plane | None = None

    def see(self, estimate: Estimate, truth: Truth, posture: Posture) -> Sight | None:
        """The sight of an estimate; of the truth it takes only what a calibrated robot knows of the
        table, and only where the scenario says that it does.
        """
        if estimate.status is not Status.LOCKED:
            return None
        m = features.moments_of_state(estimate.state, self._region, self._camera)
        self._plane = self._plane_at(m, truth, posture)
        angle, size = estimate.follows
        return Sight(m, self._plane, known=(True, True, size, angle and oriented(m)))

    def goal(self, m: Moments) -> Sight:
        """How the target shall be seen: from straight above."""
        facing = features.facing_plane(m, self._root_area)
        return Sight(m, self._told(facing))

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

    def _plane_at(self, m: Moments, truth: Truth, posture: Posture) -> Plane:
        c = self._config
        normal, ray = self._normal(truth, posture), np.array([m.xg, m.yg, 1.0])
        if c.depth == "known":
            depth = 1 / float(self._table(truth).vector @ ray)
            plane = features.plane_of_depth(m, depth, normal)
        else:
            plane = features.plane_of_size(m, self._root_area, normal)
        if c.plane == "estimated":
            self._fit.add(posture.T_base_camera, ray / float(plane.vector @ ray))
        return self._told(plane)

    def _normal(self, truth: Truth, posture: Posture) -> Array:
        match self._config.plane:
            case "parallel":
                return FACING
            case "known":
                return self._table(truth).vector
            case "estimated":
                return self._fit.normal(posture.T_base_camera)

    def _table(self, truth: Truth) -> Plane:
        """The plane of the target's reference rectangle, as a calibrated robot knows it."""
        T_camera_target = truth.T_world_camera.inverse() @ truth.T_world_target
        return features.plane_of(T_camera_target, self._height)

    def _told(self, plane: Plane) -> Plane:
        """The plane that the interaction matrix is computed with."""
        f = self._config.depth_factor
        return plane if f == 1.0 else Plane(plane.A / f, plane.B / f, plane.C / f)
