"""Values of servoing that many tests begin with."""

import numpy as np

from servo.features.moments import MomentFeatures, Scaling
from servo.parts import Task
from servo.sight.planar_pose import UNIT, CornersToPose
from servo.sight.planes import FACING, plane_of_size
from servo.types import OwnMotion, Plane
from sim.types import Camera, Pose, Posture

CAMERA = Camera(290.0, 290.0, 160.0, 120.0, 320, 240)
ROOT_AREA = float(np.sqrt(0.2 * 0.1))
OUTLINE = np.array([[-0.1, 0.05, 0.0], [0.1, 0.05, 0.0], [0.1, -0.05, 0.0], [-0.1, -0.05, 0.0]])
METRIC = MomentFeatures(Scaling.METRIC, ROOT_AREA)
PAPER = MomentFeatures(Scaling.PAPER, ROOT_AREA)


def parallel(depth):
    """A plane parallel to the image."""
    return Plane(0.0, 0.0, 1.0 / depth)


def facing(m, root_area=ROOT_AREA):
    """The plane parallel to the image in which a target of this size has these moments."""
    return plane_of_size(m, root_area, FACING)


def plane_of(T_camera_target, height):
    """The level plane at a height over the target's origin."""
    normal = T_camera_target.rotation[:, 2]
    through = T_camera_target.translation + height * normal
    return Plane(*(normal / (normal @ through)).tolist())


def posture_of(twist, accepted=None):
    """Of a robot that knows nothing but its camera's twist, and that it points down."""
    level = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    return Posture(
        level,
        np.asarray(twist),
        np.zeros(0),
        np.zeros(0),
        np.zeros(0),
        np.zeros((6, 0)),
        accepted=accepted,
    )


def own(past):
    """The camera's own part, where commands act at once."""
    past = np.asarray(past)
    return OwnMotion(past, np.zeros((0, len(past))))


def begun(estimator, features=METRIC):
    """An estimator that has begun."""
    estimator.start(features)
    return estimator


def task(goal, estimator, features=METRIC, latency=0):
    """A task with an estimator that has begun."""
    return Task(goal, features, begun(estimator, features), CAMERA, OUTLINE, latency)


def planar_pose(corners, size, expected=None):
    """The pose of a rectangle in one picture; after an expected pose, one that was taken of it from
    so near that its corners decide.
    """
    eye = CornersToPose(size)
    if expected is not None:
        near = Pose(expected.rotation, 2.0 * max(size) * unit(expected.translation))
        seen = near.apply(UNIT * (*size, 0.0))
        eye.of(seen[:, :2] / seen[:, 2:], expected @ near.inverse())
    return eye.of(corners, Pose(np.eye(3), np.zeros(3)))


def unit(vector):
    """A vector of length 1."""
    return vector / np.linalg.norm(vector)
