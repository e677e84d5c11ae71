"""Goal of a target that the robot holds in front of a standing camera: a pose relative to a leader,
which is a second tag that moves and is detected in each picture.
"""

from typing import final

import numpy as np

from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.sight.planar_pose import CornersToPose
from servo.types import Sight
from sim.geometry import mount_pose
from sim.leader import LeaderConfig
from sim.types import Array, Camera, Frame, Pose
from tracking.search.tag_detector import TagDetector
from tracking.types import Region

STANDS = Pose(np.eye(3), np.zeros(3))
"""Pose of the standing camera, relative to itself."""


@final
class Led:
    """Goal of a target that the robot holds in front of a standing camera: a pose relative to a
    leader, which is a second tag that moves. It detects the tag in each picture, and returns the
    desired view of the target: moments, corners, plane and pose in the camera frame.
    """

    moved_by = "leader.id"

    def __init__(
        self, config: LeaderConfig, outline: Array, camera: Camera, depth_factor: float = 1.0
    ) -> None:
        """Create the goal for a run.

        Args:
            config: Number and size of the leader's tag, and the desired pose relative to it.
            outline: Corners (4, 3) of the held target's reference rectangle in its frame [m].
            camera: Intrinsics, as the robot believes them.
            depth_factor: Factor on the depths of the target's plane in the desired view, to test
                laws with wrong depths; 1 leaves them. It does not change the pose.
        """
        self._number = config.id
        self._beside = mount_pose(config.beside)
        self._camera = camera
        self._tags = TagDetector()
        self._seen: Array | None = None
        self._corners_to_pose = CornersToPose((config.size, config.size))
        region = Region(1.0, 1.0)  # a pose needs no template
        self._to_sight = EstimateToSight(SightConfig(), camera, region, outline, depth_factor)

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight | None:
        """Return the desired view of the held target for a picture: moments and corners in
        normalised image coordinates, and plane and pose in the camera frame. The result is None if
        the leader's tag is not found in the picture, or its corners fit no pose.

        Args:
            frame: The picture in which the leader's tag is detected.
            by_corners: Not used.
        """
        if self._number is not None:
            self._seen = self._tags.find(frame.image, self._number, self._seen)
        if self._seen is None:
            return None
        pose = self._corners_to_pose.of(self._camera.normalise(self._seen), STANDS)
        return None if pose is None else self._to_sight.at(pose @ self._beside)
