"""Where the held target shall be, as the camera sees it: beside a leader's tag."""

from typing import final

import numpy as np

from servo.sight.planar_pose import CornersToPose
from sim.kinematics.model import mount_pose
from sim.leader import LeaderConfig
from sim.types import Array, Camera, Image, Pose
from tracking.trackers.tag import Tag

STANDS = Pose(np.eye(3), np.zeros(3))
"""The camera's pose: it never moves."""


@final
class LeaderSight:
    """Finds the leader's tag anew in each picture."""

    def __init__(self, config: LeaderConfig, camera: Camera) -> None:
        self._number = config.id
        self._beside = mount_pose(config.beside)
        self._camera = camera
        self._tag = Tag()
        self._seen: Array | None = None
        self._corners_to_pose = CornersToPose((config.size, config.size))

    def goal(self, image: Image) -> Pose | None:
        """Return T_camera_object of the target's goal, None where the tag is not seen."""
        if self._number is not None:
            self._seen = self._tag.find(image, self._number, self._seen)
        if self._seen is None:
            return None
        pose = self._corners_to_pose.of(self._camera.normalise(self._seen), STANDS)
        return None if pose is None else pose @ self._beside
