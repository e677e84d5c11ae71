"""The workspace of a robot's camera, sampled from random postures, and a base that suits it."""

from dataclasses import dataclass
from math import atan2, degrees

import mujoco
import numpy as np

from sim.geometry import tilt
from sim.robot.drives import random_joints
from sim.robot.robot import Robot
from sim.robot.start_pose import comfort
from sim.types import Array

SAMPLES = 4000
LEVEL = np.radians(25.0)
"""A camera whose axis is nearer than this to straight down looks at the table."""
BEST = 0.2
"""The part of the postures, the most comfortable ones, from which a base is proposed."""

ONE_SIDED = 0.5
"""Mean place over mean distance of those postures from which on an arm has a direction."""


@dataclass(frozen=True, slots=True)
class Workspace:
    """The reach of the camera, in the robot's own frame."""

    farthest: float
    """From the base's origin [m]."""
    lowest: float
    """Height over the base at which it looks down at the table [m]; nan where it never does."""
    highest: float
    """Height over the base at which it looks down at the table [m]."""
    base: tuple[float, float, float, float]
    """A place for the base, x, y, z [m] and yaw [deg], at which the camera is comfortable over the
    table's middle."""


def sample_workspace(robot: Robot, height: float) -> Workspace:
    """Try random postures of a robot whose base is the world's origin.

    Args:
        robot: The robot.
        height: Where the camera shall be over the table [m].
    """
    model = robot.model
    data = mujoco.MjData(robot.model)
    rows: list[list[float]] = []
    far = 0.0
    for q in random_joints(model, robot.ids, np.random.default_rng(0), SAMPLES):
        data.qpos[robot.qpos] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        eye = robot.eye(data)
        far = max(far, float(np.linalg.norm(eye.translation)))
        if tilt(eye.rotation) < LEVEL:
            rows.append([comfort(robot, data), *eye.translation])
    if not rows:
        return Workspace(far, np.nan, np.nan, (0.0, 0.0, 0.0, 0.0))
    found = np.array(rows)
    return Workspace(far, found[:, 3].min(), found[:, 3].max(), _base(found, height))


def _base(found: Array, height: float) -> tuple[float, float, float, float]:
    """A base for the best of these postures, behind the table's middle."""
    order = np.argsort(-found[:, 0])[: max(1, round(BEST * len(found)))]
    best = found[order]
    away = np.median(np.hypot(best[:, 1], best[:, 2]))
    above = np.median(best[:, 3])
    x, y = best[:, 1:3].mean(axis=0)
    # Most arms turn about an upright axis first: all directions are then as good as along x.
    ahead = degrees(atan2(y, x)) if np.hypot(x, y) > ONE_SIDED * away else 0.0
    yaw = 5.0 * round(((90.0 - ahead) % 360.0 - 180.0) / 5.0)
    return 0.0, round(float(away), 2), round(float(height - above), 2), yaw
