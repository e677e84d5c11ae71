"""How the target shall be seen, at any time of a run."""

from dataclasses import replace
from math import radians
from typing import final

import numpy as np

from servo.loop.settings import GoalConfig
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.types import Sight
from sim.placement import truth_above
from sim.types import Array, Camera, Pose, Truth
from tracking.types import Region, State


@final
class Goal:
    """The target, faced at a pixel, an angle and a depth."""

    def __init__(
        self,
        config: GoalConfig,
        outline: Array,
        pictured: Camera,
        seen: Camera,
        depth_factor: float = 1.0,
    ) -> None:
        """Keep what is asked for.

        Args:
            config: Where and how near.
            outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
            pictured: Gives the goal's picture its size [px].
            seen: Takes this picture to rays.
            depth_factor: As for `EstimateToSight`.
        """
        self._config = config
        self._outline = outline
        self._camera = pictured
        self.pixel = np.array([pictured.width / 2 + config.x, pictured.height / 2 + config.y])
        """Where the target's centre shall be (2,) [px]."""
        self.theta = radians(config.angle_deg)
        """Direction in which the target's nose shall point, at its centre [rad]."""
        self._faced: dict[float, Truth] = {}
        region = Region(1.0, 1.0)  # each goal brings its own
        self._to_sight = EstimateToSight(SightConfig(), seen, region, outline, depth_factor)

    def truth(self, time: float, T_world_camera: Pose) -> Truth:
        """Return the truth if a camera with this pose had the target where it shall be at a time
        [s].
        """
        faced = self._at(self._config.depth_at(time))
        T_camera_target = faced.T_world_camera.inverse() @ faced.T_world_target
        return replace(
            faced, T_world_camera=T_world_camera, T_world_target=T_world_camera @ T_camera_target
        )

    def sight(self, time: float, *, by_corners: bool = False) -> Sight:
        """Return the sight that the target shall have at a time [s].

        Args:
            time: Of the run.
            by_corners: For a tracker that reports the target's corners: a lens that distorts, or
                pixels that are not square, show them as no rectangle of the target's shape. Other
                trackers report a rectangle, which shall be one at the goal.
        """
        faced = self._at(self._config.depth_at(time))
        if by_corners and not self._camera.is_plain:
            return self._to_sight.goal_of(faced.corners)
        length, width = np.ptp(self._outline[:, :2], axis=0) * faced.size
        x, y = faced.centre.tolist()
        return self._to_sight.goal(State(x, y, faced.theta), Region(length, width))

    def _at(self, depth: float) -> Truth:
        """Return what is seen of a target that is faced at a depth [m]; the last one is kept."""
        if depth not in self._faced:
            camera = self._camera
            faced = truth_above(camera, self._outline, self.pixel, self.theta, depth)
            if camera.distortion is None:
                # Without a lens these are known without the rounding of a projection.
                size = camera.focal / depth
                faced = replace(faced, centre=self.pixel, theta=self.theta, size=size)
            self._faced = {depth: faced}
        return self._faced[depth]
