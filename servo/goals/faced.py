"""Goal at which the target has a given position and angle in the picture, a given depth and a given
tilt; the depth may change once in the run, at constant speed.
"""

from dataclasses import dataclass, replace
from math import radians
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.types import Sight
from sim.outline import Outline
from sim.placement import object_pose, truth_above
from sim.ranges import Degrees, Interval, Time
from sim.types import Array, Camera, Frame, Pose, Truth
from tracking.types import Region, State

Pixels = Annotated[float, Ge(-10_000), Le(10_000)]
Depth = Annotated[float, Ge(0.01), Le(100)]


@dataclass(frozen=True, slots=True)
class GoalConfig:
    """Settings of the goal: position, angle and distance at which the camera should see the target.

    The position is in px to the right of the image's centre and below it. The angle is the
    direction of the target's nose, from right towards down, in degrees. The distance is in m, and
    with `depth_to` it changes once in the run, at constant speed. By default the camera faces the
    target; `tilt_deg` moves it around the target's centre by an angle, in the direction
    `tilt_towards_deg` in the picture, from right towards down.
    """

    x: Pixels = 0.0
    """Distance to the right of the image's centre [px]."""
    y: Pixels = 0.0
    """Distance below the image's centre [px]."""
    angle_deg: Degrees = 0.0
    """Direction of the target's nose, from right towards down [deg]."""
    depth: Depth = 1.0
    """Distance of the target's reference rectangle [m]."""
    depth_to: Depth | None = None
    """Distance to which the goal changes [m]; by default it stays."""
    tilt_deg: Annotated[float, Ge(0), Le(80)] = 0.0
    """Tilt of the camera [deg]: placed by the settings above, it is then moved around the target's
    centre by this angle; the centre keeps its pixel and depth. Needs a tracker that reports
    corners, or a method that compares pictures."""
    tilt_towards_deg: Degrees = 0.0
    """Direction in the picture in which the tilt moves the camera, from right towards down
    [deg]."""
    change_start: Time = 3.0
    """Time at which the goal begins to change [s]."""
    change_duration: Interval = 3.0
    """Duration of the change, at constant speed [s]."""

    def depth_at(self, time: float) -> float:
        """Return the desired distance of the target [m] at a time of the run [s]: `depth`; if
        `depth_to` is set, it changes linearly from `depth` to `depth_to`, from `change_start` on
        for `change_duration`.
        """
        done = min(max((time - self.change_start) / self.change_duration, 0.0), 1.0)
        return self.depth + done * ((self.depth_to or self.depth) - self.depth)


@final
class Faced:
    """Goal given by the target's position [px], angle, depth and tilt; without a tilt the target's
    plane is parallel to the image. The depth may change once in the run. For each time it returns
    the desired view of the target: moments, corners, plane and pose in the camera frame.
    """

    def __init__(
        self,
        config: GoalConfig,
        outline: Array,
        pictured: Camera,
        seen: Camera,
        depth_factor: float = 1.0,
    ) -> None:
        """Create the goal for a run.

        Args:
            config: Pixel, angle and distance of the target at the goal.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            pictured: Camera with which the target's picture at the goal is computed.
            seen: Camera with which pixels of that picture are converted to normalised image
                coordinates.
            depth_factor: Factor on the depths of the target's plane in the desired view, to test
                laws with wrong depths; 1 leaves them. It does not change the pose.
        """
        self._config = config
        self._outline = outline
        self._camera = pictured
        self.pixel = np.array([pictured.width / 2 + config.x, pictured.height / 2 + config.y])
        """Goal (2,) of the target's centre [px]."""
        self.theta = radians(config.angle_deg)
        """Goal of the direction of the target's nose, from right towards down [rad]."""
        self._faced: dict[float, Truth] = {}
        self._sights: dict[tuple[float, bool], Sight] = {}
        self.moved_by = "" if config.depth_to is None else "goal.depth_to"
        """The setting that makes the goal move; "" for a fixed goal."""
        region = Region(1.0, 1.0)  # each goal brings its own
        self._to_sight = EstimateToSight(SightConfig(), seen, region, outline, depth_factor)

    def truth(self, time: float, T_world_camera: Pose) -> Truth:
        """Return where a target at its goal would be, for a camera with a given pose: the poses of
        camera and target in the world frame, and the target's centre [px], angle [rad], size [px/m]
        and corners (4, 2) [px] in the picture.

        Args:
            time: Time of the run [s], by which the goal's depth may change.
            T_world_camera: Pose of the camera in the world frame.
        """
        faced = self._at(self._config.depth_at(time))
        return Truth(
            faced.centre,
            faced.theta,
            faced.size,
            faced.corners,
            T_world_camera,
            T_world_camera @ self._T_camera_target,
            faced.visible,
        )

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight:
        """Return the desired view of the target at the time of a frame: moments and corners in
        normalised image coordinates, and plane and pose in the camera frame.

        Args:
            frame: The frame; only its time is used.
            by_corners: Whether the tracker reports the target's four corners, and not only a
                rectangle in the picture.
        """
        return self.sight_at(frame.time, by_corners=by_corners)

    def sight_at(self, time: float, *, by_corners: bool = False) -> Sight:
        """Return the desired view of the target at a time of the run: moments and corners in
        normalised image coordinates, and plane and pose in the camera frame.

        Args:
            time: Time of the run [s].
            by_corners: True for a tracker that reports the target's four corners: through a lens
                that distorts, or with pixels that are not square, the desired corners are then
                those of the rectangle's distorted picture. False: they are those of a rectangle in
                the picture, which is all that the tracker can report. It has no effect on a tilted
                goal.
        """
        depth = self._config.depth_at(time)
        if (depth, by_corners) not in self._sights:
            self._sights = {(depth, by_corners): self._sight(depth, by_corners=by_corners)}
        return self._sights[depth, by_corners]

    def _sight(self, depth: float, *, by_corners: bool) -> Sight:
        faced = self._at(depth)
        if self._config.tilt_deg:
            return self._to_sight.tilted_goal(faced.corners, object_pose(faced, self._outline))
        if by_corners and not self._camera.is_plain:
            return self._to_sight.goal_of(faced.corners)
        outline = Outline(self._outline)
        x, y = faced.centre.tolist()
        return self._to_sight.goal(
            State(x, y, faced.theta),
            Region(outline.length * faced.size, outline.width * faced.size),
        )

    def _at(self, depth: float) -> Truth:
        """Return the true poses and picture of a target at the goal with a depth [m]. The result
        for the last depth is cached.
        """
        if depth not in self._faced:
            camera = self._camera
            c = self._config
            faced = truth_above(
                camera,
                self._outline,
                self.pixel,
                self.theta,
                depth,
                radians(c.tilt_deg),
                radians(c.tilt_towards_deg),
            )
            if camera.distortion is None and not c.tilt_deg:
                # Without a lens these are known without the rounding of a projection.
                size = camera.focal / depth
                faced = replace(faced, centre=self.pixel, theta=self.theta, size=size)
            self._faced = {depth: faced}
            self._T_camera_target = faced.T_world_camera.inverse() @ faced.T_world_target
        return self._faced[depth]
