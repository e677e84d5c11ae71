"""The workspace of a robot's camera, found from random joint positions, and the camera twists that
the robot's joints can make.
"""

from dataclasses import dataclass
from math import atan2, degrees

import mujoco
import numpy as np

from sim.geometry import tilt
from sim.kinematics.drives import random_joints
from sim.kinematics.inverse_kinematics import comfort
from sim.kinematics.robot import Robot
from sim.types import Array

SAMPLES = 4000
"""Number of random postures."""
BEST = 0.2
"""The base is proposed from this share of the postures, the most comfortable ones."""
LEVEL = np.radians(25.0)
"""The camera looks down if the angle between its axis and straight down is below this [rad]."""
WEAK = 1e-6
"""Singular values of the Jacobian below this share of the largest count as zero."""


@dataclass(frozen=True, slots=True)
class Workspace:
    """Where a robot's camera can be, from the origin of the robot's base [m]: its largest distance,
    and its least and largest height while it looks down, within 25 deg of the vertical (nan if it
    never does); and a proposed base in the room: x, y, z [m] and yaw [deg].
    """

    farthest: float
    """Largest distance of the camera from the base's origin [m]."""
    lowest: float
    """Least height of the camera above the base's origin where it looks down [m]; nan if it never
    looks down."""
    highest: float
    """Largest height of the camera above the base's origin where it looks down [m]; nan if it never
    looks down."""
    base: tuple[float, float, float, float]
    """x, y, z [m] and yaw [deg] of a base in the room, behind the table's middle as seen from the
    comfortable postures in which the camera looks down; zeros if it never looks down."""


def sample_workspace(robot: Robot, height: float) -> Workspace:
    """Return the workspace of a robot's camera, estimated from 4000 random sets of joint positions,
    and a proposed base of the robot in the room.

    Args:
        robot: The robot, with its base at the world's origin.
        height: Height above the table [m] at which the camera shall look down from the proposed
            base.
    """
    data = mujoco.MjData(robot.model)
    rows: list[list[float]] = []
    farthest = 0.0
    for q in random_joints(robot.model, robot.ids, np.random.default_rng(0), SAMPLES):
        eye = robot.place(data, q)
        farthest = max(farthest, float(np.linalg.norm(eye.translation)))
        if tilt(eye.rotation) < LEVEL:
            rows.append([comfort(robot, data), *eye.translation])
    if not rows:
        return Workspace(farthest, np.nan, np.nan, (0.0, 0.0, 0.0, 0.0))
    found = np.array(rows)
    best = found[np.argsort(-found[:, 0])[: max(1, round(BEST * len(found)))], 1:]
    distance = np.median(np.hypot(best[:, 0], best[:, 1]))
    x, y, _ = best.mean(axis=0)
    yaw = 5.0 * round(((90.0 - degrees(atan2(y, x))) % 360.0 - 180.0) / 5.0)
    above = float(height - np.median(best[:, 2]))
    base = (0.0, round(float(distance), 2), round(above, 2), yaw)
    return Workspace(farthest, found[:, 3].min(), found[:, 3].max(), base)


def movable_shares(jacobian: Array) -> Array:
    """Return how well the joints can make each component of the camera's twist alone (6,): 1 if
    exactly, 0 if not at all. It is the length of the component's unit vector after projection onto
    the twists that the joints can make.

    Args:
        jacobian: The matrix (6, n) from joint rates to the camera's twist.
    """
    basis, strengths, _ = np.linalg.svd(jacobian, full_matrices=False)
    return np.linalg.norm(basis[:, strengths > WEAK * strengths[0]], axis=1)
