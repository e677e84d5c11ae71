"""Warnings about the units of a robot's model: lengths in mm, and angles in degrees."""

import numpy as np

from sim.kinematics.model import FARTHEST
from sim.kinematics.robot import Robot
from sim.mounting import CAMERA

LONGEST = 20.0
"""Length of all links together [m] beyond which a model is thought to be in mm: no robot on a table
needs so much."""
WIDEST = 100.0
"""Range of a hinge [rad] beyond which it is thought to be in degrees: it is 16 turns."""


def doubts(robot: Robot) -> list[str]:
    """Return a sentence for each unit that a robot's model seems to have wrong: if its links are
    more than 20 m long together, as if lengths were in mm, or if hinges have ranges of more than
    100 rad, as if limits were in degrees. The list is empty if nothing seems wrong.
    """
    lines: list[str] = []
    length = _length(robot)
    if length > LONGEST:
        lines.append(
            f"The robot's links are {length:.0f} m long together: are the model's lengths in mm?"
        )
    ranges = robot.upper - robot.lower
    given = np.maximum(-robot.lower, robot.upper) < FARTHEST
    wide = (np.array(robot.units) == "rad") & given & (ranges > WIDEST)
    if wide.any():
        names = ", ".join(np.array(robot.names)[wide])
        lines.append(
            f"Joints that turn by up to {ranges[wide].max():.0f} rad: {names}. Are the model's "
            "limits in degrees?"
        )
    return lines


def _length(robot: Robot) -> float:
    """Return the sum of the distances between the bodies from the base to the camera [m]."""
    model = robot.model
    eye = model.site(CAMERA)
    body = int(eye.bodyid[0])
    length = float(np.linalg.norm(eye.pos))
    # The place of the first body is that of the robot in the room.
    while model.body_parentid[body]:
        length += float(np.linalg.norm(model.body_pos[body]))
        body = int(model.body_parentid[body])
    return length
