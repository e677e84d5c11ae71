"""Conversion of a tracker's estimate to the target as a control law needs it (`Sight`): its
moments, corners, plane and pose in the camera frame.
"""

from dataclasses import dataclass, replace
from math import sqrt
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Le

from servo.sight import shape_moments
from servo.sight.certainty import certain
from servo.sight.depth_points import DepthPoints
from servo.sight.exact import plane_in, sight_of
from servo.sight.planar_pose import CornersToPose, refined
from servo.sight.planes import FACING, PlaneFit, level_plane, plane_of_depth, plane_of_size
from servo.types import Moments, Plane, Sight
from sim.channels import Channel, Channels
from sim.geometry import exp_se3
from sim.outline import Outline
from sim.types import Array, Camera, DepthPicture, Pose, Posture
from tracking.types import Estimate, Region, State, Status


@dataclass(frozen=True, slots=True)
class SightConfig:
    """Settings of the sources from which the target's plane and depth are computed.

    The plane is parallel to the image, known from the robot's posture, fitted to the target's
    positions so far, or fitted to depth pictures. The depth comes from the target's size, from the
    posture and the height of the table over the room's origin [m], or from depth pictures. If the
    tracker measures the target's corners, plane and depth come from these instead; only the depth
    may still come from depth pictures.
    """

    plane: Literal["parallel", "known", "estimated", "picture"] = "parallel"
    """Normal of the target's plane: "parallel" to the image, "known" from the robot's posture (the
    table is level), "estimated" from where the target has been seen to drive, or from the depth
    "picture" by least squares, which measures the tilt."""
    depth: Literal["size", "known", "picture"] = "size"
    """Depth of the target, for the interaction matrix: from its metric "size" and its area in the
    image, "known" from the robot's posture and table_height, or the median of its region in the
    depth "picture". All features are then those of the rectangle of this size at that depth."""
    table_height: Annotated[float, Ge(-5), Le(5)] = 0.0
    """Height of the table over the room's origin [m]."""

    @property
    def needs(self) -> Channels:
        """Kinds of additional data (channels) that these settings need: depth pictures if plane or
        depth is taken from them, otherwise none.
        """
        uses = "picture" in (self.plane, self.depth)
        return frozenset({Channel.DEPTH}) if uses else frozenset()


@final
class EstimateToSight:
    """Converts tracker estimates and goals, which are in pixels, to moments and corners in
    normalised image coordinates, and plane and pose in the camera frame (`Sight`), by the camera's
    intrinsics and the target's metric size. It also computes how a camera motion moves the target
    in the picture.
    """

    def __init__(
        self,
        config: SightConfig,
        camera: Camera,
        region: Region,
        outline: Array,
        depth_factor: float = 1.0,
    ) -> None:
        """Create the converter for a run.

        Args:
            config: Where the target's plane and depth come from.
            camera: Intrinsics of the camera.
            region: The target's rectangle in the first picture [px].
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            depth_factor: Factor on the depths of the target's plane, to test laws with wrong
                depths; 1 leaves them. It does not change the pose.
        """
        self._config = config
        self._camera = camera
        self._region = region
        self._depth_factor = depth_factor
        self._outline = outline
        self._root_area = sqrt(Outline(outline).area)
        self._height = config.table_height + float(outline[0, 2])
        self._fit = PlaneFit()
        sides = Outline(outline)
        self._corners_to_pose = CornersToPose((sides.length, sides.width))
        self._plane: Plane | None = None

    def see(
        self,
        estimate: Estimate,
        posture: Posture,
        goal: Sight | None = None,
        depth: DepthPicture | None = None,
    ) -> Sight | None:
        """Return the target as an estimate shows it: moments and corners in normalised image
        coordinates, and plane and pose in the camera frame. The result is None if the tracker's
        status is not LOCKED, its centre is too uncertain, or its corners are not the picture of a
        rectangle of the target's size.

        An angle or a size that a tracker without corners does not follow, or states too
        uncertainly, is marked as not measured; but a size that follows from the depth picture
        counts as measured.

        Args:
            estimate: The tracker's estimate [px, rad]. If it has corners, plane and pose are
                computed from them; only the distance may be that of the depth picture.
            posture: Pose, twist and joints of the robot when the picture was taken.
            goal: The desired view of the target, which is stored in the result.
            depth: Depth picture (H, W) [m]; used only if the settings take plane or depth from it.
                If fewer than 20 pixels of the target have a depth, the target's size replaces it as
                the source of the depth, and a plane parallel to the image (or that of the corners)
                replaces the plane from it.
        """
        is_placed, is_turned, is_sized = certain(estimate, self._region)
        if estimate.status is not Status.LOCKED or not is_placed:
            return None
        if estimate.corners is not None:
            return self._see_corners(estimate.corners, posture, goal, depth)
        # A tracker of a region: its rectangle gives moments and corners, the settings the plane.
        m = shape_moments.of_state(estimate.state, self._region, self._camera)
        corners = self._region.corners(estimate.state)
        points = self._points(corners, depth)
        plane = self._plane_at(m, posture, points)
        self._plane = self._scaled(plane)
        # Angle and size count only if the tracker follows them, and is certain of them.
        angle = estimate.follows[0] and is_turned
        size = estimate.follows[1] and is_sized
        is_tilt_seen = self._config.plane == "picture" and points is not None
        seen = self._camera.normalise(corners)
        sight = Sight(m, plane, angle, size, is_tilt_seen, corners=seen, goal=goal)
        if self._config.depth == "picture" and points is not None:
            # The measured distance and the metric size determine the size in the picture, also for
            # trackers that do not follow it.
            whole = sight_of(sight.pose, self._outline, goal)
            sight = replace(whole, angle_known=angle, tilt_known=is_tilt_seen)
        return self._with_depth_factor(sight)

    def goal(self, state: State, region: Region) -> Sight:
        """Return the desired view of a target whose plane is parallel to the image, with moments
        and corners (in normalised image coordinates) of a rectangle in the picture, as a tracker of
        rectangles would report it.

        Args:
            state: Position [px], angle [rad] and scale of the target at the goal.
            region: Width and height of the target's rectangle at scale 1 [px].
        """
        m = shape_moments.of_state(state, region, self._camera)
        corners = self._camera.normalise(region.corners(state))
        plane = plane_of_size(m, self._root_area, FACING)
        return self._with_depth_factor(Sight(m, plane, tilt_known=True, corners=corners))

    def goal_of(self, corners: Array) -> Sight:
        """Return the desired view of a target whose plane is parallel to the image, from its
        corners at the goal.

        Args:
            corners: Corners (4, 2) [px] in the order rear left, front left, front right, rear
                right.
        """
        seen = self._camera.normalise(corners)
        m = shape_moments.of_polygon(seen)
        plane = plane_of_size(m, self._root_area, FACING)
        return self._with_depth_factor(Sight(m, plane, tilt_known=True, corners=seen))

    def tilted_goal(self, corners: Array, about: Pose) -> Sight:
        """Return the desired view of a target that is seen from the side: that of the pose in the
        camera frame which fits its corners at the goal best.

        Args:
            corners: Corners (4, 2) of the target at the goal [px], in the order rear left, front
                left, front right, rear right.
            about: Pose T_camera_object from which the fit starts: that at the goal for the camera
                that sees these corners, which may differ from this converter's camera.
        """
        sides = Outline(self._outline)
        size = sides.length, sides.width
        return self.at(refined(about, self._camera.normalise(corners), size))

    def at(self, pose: Pose) -> Sight:
        """Return the desired view of a target (moments, corners, plane) at a desired pose.

        Args:
            pose: Pose T_camera_object in the camera frame [m]: origin in the centre of the target's
                rectangle, x along its nose, z along the rectangle's normal, away from the camera.
        """
        return self._with_depth_factor(sight_of(pose, self._outline))

    def _see_corners(
        self, corners: Array, posture: Posture, goal: Sight | None, depth: DepthPicture | None
    ) -> Sight | None:
        """Return the view of the target, with its pose, from its four corners (4, 2) [px]; None if
        they are not the picture of a rectangle of its size.
        """
        seen = self._camera.normalise(corners)
        pose = self._corners_to_pose.of(seen, posture.T_base_camera)
        if pose is None:
            return None
        m = shape_moments.of_polygon(seen)
        points = self._points(corners, depth)
        if self._config.depth == "picture" and points is not None:
            # A wrong metric size makes only the distance wrong: scale it to the measured depth.
            there = points.plane(pose.rotation[:, 2]).vector @ pose.translation
            whole = sight_of(Pose(pose.rotation, pose.translation / there), self._outline, goal)
            self._plane = self._scaled(whole.plane)
            return self._with_depth_factor(whole)
        plane = plane_in(pose)
        self._plane = self._scaled(plane)
        return self._with_depth_factor(
            Sight(m, plane, tilt_known=True, corners=seen, measured_pose=pose, goal=goal)
        )

    def _with_depth_factor(self, sight: Sight) -> Sight:
        """Return a view of the target in which the depths of its plane are multiplied by the depth
        factor; its pose is not changed.
        """
        if self._depth_factor == 1.0:
            return sight
        return replace(sight, plane=self._scaled(sight.plane), measured_pose=sight.pose)

    def ego(self, state: State, twist: Array, dt: float) -> Array:
        """Return how a camera motion moves a target at rest in the picture: the changes (4,) of its
        x, y [px], angle [rad] and ln scale.

        It is computed from two points of the target's plane, the centre and the middle of the
        rectangle's front side. The plane is that of the last view that `see` returned; before the
        first one the result is zero.

        Args:
            state: Position [px], angle [rad] and scale of the target before the motion.
            twist: Camera twist (6,) in the camera frame [m/s, rad/s].
            dt: Duration of the motion [s].
        """
        if self._plane is None:
            return np.zeros(4)
        _, right, below, _ = self._region.corners(state)
        before = np.array([[state.x, state.y], (right + below) / 2])
        rays = np.ones((2, 3))
        rays[:, :2] = self._camera.normalise(before)
        points = rays / (rays @ self._plane.vector)[:, None]
        after = self._camera.project(exp_se3(twist * dt).inverse().apply(points))
        arm = [complex(*(ends[1] - ends[0])) for ends in (before, after)]
        turned = np.log(arm[1] / arm[0])
        return np.array([*(after[0] - before[0]), turned.imag, turned.real])

    def _points(self, corners: Array, depth: DepthPicture | None) -> DepthPoints | None:
        """Return the target's points in a depth picture; None if there is no depth picture, it has
        too few depths of the target, or neither plane nor depth is taken from it.
        """
        if depth is None or not self._config.needs:
            return None
        return DepthPoints.inside(corners, depth, self._camera)

    def _plane_at(self, m: Moments, posture: Posture, points: DepthPoints | None) -> Plane:
        c = self._config
        normal = self._normal(posture, points)
        ray = np.array([m.xg, m.yg, 1.0])
        if c.depth == "known":
            depth = 1 / float(level_plane(posture.T_base_camera, self._height).vector @ ray)
            plane = plane_of_depth(m, depth, normal)
        elif c.depth == "picture" and points is not None:
            plane = points.plane(normal)
        else:
            plane = plane_of_size(m, self._root_area, normal)
        if c.plane == "estimated":
            self._fit.add(posture.T_base_camera, ray / float(plane.vector @ ray))
        return plane

    def _normal(self, posture: Posture, points: DepthPoints | None) -> Array:
        match self._config.plane:
            case "parallel":
                return FACING
            case "known":
                return level_plane(posture.T_base_camera, self._height).vector
            case "estimated":
                return self._fit.normal(posture.T_base_camera)
            case "picture":
                return FACING if points is None else points.normal

    def _scaled(self, plane: Plane) -> Plane:
        """Return the plane with its depths multiplied by the depth factor."""
        f = self._depth_factor
        return plane if f == 1.0 else Plane(plane.A / f, plane.B / f, plane.C / f)
