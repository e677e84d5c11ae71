"""A target put anywhere before a still camera, tilted and turned, with the truth of its corners."""

import numpy as np

from sim.camera.camera import CameraConfig
from sim.geometry import exp_so3
from sim.robots import gantry
from sim.types import Pose
from sim.world import World, WorldParts
from tracking.types import Region, State

FACE = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
"""T_target_object: from z up to z into the table."""


class Put:
    """A motion that is where it was put."""

    pose = Pose.planar(0.0, 0.0, 0.0)

    def at(self, time):
        return self.pose


class Scene:
    """Pictures of a target where it is put before the camera; close it."""

    def __init__(self, target, width=640, height=480, focal=600.0, **camera):
        rng = np.random.default_rng(0)
        self._put = Put()
        config = CameraConfig(width=width, height=height, fx=focal, rate=240.0, **camera)
        parts = WorldParts(gantry.Config().build(rng), target.build(rng), self._put, camera=config)
        self.world = World(parts, rng)
        self.world.start(np.array([width, height]) / 2, 0.0, 1.0)
        self.eye = self.world.truth().T_world_camera

    def show(self, T_camera_object):
        """The frame, and the true corners (4, 2), at a pose that is the identity where the target
        faces the camera.
        """
        self._put.pose = self.eye @ T_camera_object @ FACE.inverse()
        self.world.step(np.zeros(6))
        return self.world.look(), self.world.truth().corners

    def close(self):
        self.world.close()


def tilted(tilt, axis, turn, place):
    """A pose: turned about its normal, then tilted about an axis in the image [deg]."""
    across = np.radians(tilt) * np.array([np.cos(np.radians(axis)), np.sin(np.radians(axis)), 0.0])
    R = exp_so3(across) @ exp_so3(np.array([0.0, 0.0, np.radians(turn)]))
    return Pose(R, np.asarray(place, dtype=float))


def placed(corners):
    """The region and the state of a rectangle that faces the camera, from its corners (4, 2)."""
    along, down = corners[1] - corners[0], corners[3] - corners[0]
    region = Region(float(np.hypot(*along)), float(np.hypot(*down)))
    return region, State(*corners.mean(axis=0).tolist(), float(np.arctan2(along[1], along[0])))


def rms(found, true):
    """Root mean square distance of corners (4, 2) [px]."""
    return float(np.sqrt(np.mean(np.sum((found - true) ** 2, axis=-1))))
