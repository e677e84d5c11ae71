"""The way of a robot's joints along a motion, by their rates alone: does one come to the end of its
range?
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import mujoco
import numpy as np

from sim.geometry import exp_se3, log_se3
from sim.kinematics.robot import Robot
from sim.types import Pose

STEP = 0.2
"""Time between two poses of a way [s]."""
FORESEEN = 20.0
"""Longest way [s]: of seven joints it takes 30 ms."""
SETTLING = 1.0
"""Time constant with which the camera goes from its start to the way [s]."""


@dataclass(frozen=True, slots=True)
class Rollout:
    """How far the joints come."""

    room: float
    """Least way of a joint to an end of its range, as a part of this range."""
    joint: str = ""
    """The joint that comes to the end of its range first; empty where none does."""
    time: float = np.inf
    """When it does [s]."""


def roll_out(robot: Robot, data: mujoco.MjData, way: Sequence[Pose]) -> Rollout:
    """Follow a way from where the joints are, until one comes to the end of its range.

    Args:
        robot: Its joints.
        data: Where they are; it is the same afterwards.
        way: Poses of the camera, as `Robot.eye` has them, a `STEP` apart.
    """
    begin = data.qpos[robot.qpos].copy()
    limited = np.isfinite(robot.upper - robot.lower)
    lower = robot.lower[limited]
    upper = robot.upper[limited]
    beside = log_se3(way[0].inverse() @ robot.eye(data))
    room = np.inf
    joint = ""
    time = np.inf
    for k, pose in enumerate(way[1:], 1):
        there = pose @ exp_se3(exp(-k * STEP / SETTLING) * beside)
        twist = log_se3(robot.eye(data).inverse() @ there) / STEP
        rates, _, limits = robot.rates(data, twist)
        joint = next((name for name in robot.names if f"{name} (range)" in limits), "")
        if joint:
            time = k * STEP
            break
        data.qpos[robot.qpos] += STEP * rates
        robot.refresh(data)
        q = data.qpos[robot.qpos][limited]
        nearest = np.minimum(q - lower, upper - q) / (upper - lower)
        room = min(room, float(nearest.min(initial=np.inf)))
    data.qpos[robot.qpos] = begin
    robot.refresh(data)
    return Rollout(room, joint, time)
