"""Prediction of the joint positions along a camera path: which joint reaches a limit, and when."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import mujoco
import numpy as np

from sim.geometry import exp_se3, log_se3
from sim.kinematics.robot import Robot
from sim.types import Pose

STEP = 0.2
"""Time between two poses of a path [s]."""
FORESEEN = 20.0
"""Longest path [s]; with seven joints its prediction takes 30 ms."""
SETTLING = 1.0
"""Time constant with which the camera moves from its start to the path [s]."""


@dataclass(frozen=True, slots=True)
class Rollout:
    """Predicted result of following a camera path by joint rates: the smallest distance of a joint
    from a limit on the path, as a share of its range (`room`; inf if no joint has limits, or if one
    is reached in the first step); the name of the joint that reaches a limit first, and the time
    when it does [s]; "" and inf if no joint does.
    """

    room: float
    """Smallest distance of a joint from a limit on the path, as a share of its range; inf if no
    joint has limits, or one is reached at the first step."""
    joint: str = ""
    """Name of the joint that reaches a limit first; empty if no joint does."""
    time: float = np.inf
    """Time at which this joint reaches its limit [s]; inf if no joint does."""


def roll_out(robot: Robot, data: mujoco.MjData, way: Sequence[Pose]) -> Rollout:
    """Predict whether a joint reaches a limit when the camera follows a path: joint rates for the
    path are integrated from the present positions in steps of 0.2 s, up to the first joint whose
    range limits its rate. If the camera begins beside the path, its offset from the path decays
    with a time constant of 1 s.

    Args:
        robot: The robot.
        data: MuJoCo's state; its joint positions are the start, and are restored afterwards.
        way: Desired camera poses every 0.2 s, at least one: T_world_camera, or T_target_camera if
            the robot holds the target.

    Returns:
        The smallest distance of a joint from a limit on the path, as a share of its range; and the
        name of the joint that reaches a limit with its time [s], or "" and inf.
    """
    begin = robot.joints(data)
    beside = log_se3(way[0].inverse() @ robot.eye(data))
    room = np.inf
    joint = ""
    time = np.inf
    # The start may lie beside the path: its offset decays exponentially, as under a control law.
    for k, pose in enumerate(way[1:], 1):
        there = pose @ exp_se3(exp(-k * STEP / SETTLING) * beside)
        twist = log_se3(robot.eye(data).inverse() @ there) / STEP
        rates, _, limits = robot.rates(data, twist)
        joint = next((name for name in robot.names if f"{name} (range)" in limits), "")
        if joint:
            time = k * STEP
            break
        robot.place(data, robot.joints(data) + STEP * rates)
        room = min(room, float(robot.room(data).min()))
    robot.place(data, begin)
    return Rollout(room, joint, time)
