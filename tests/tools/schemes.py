"""The schemes of the reference data: their feature sets, poses, and the kinematic loop."""

import numpy as np

from servo.features import hybrid, points, polar, pose, segment
from servo.sight.exact import sight_of
from sim.geometry import exp_so3
from sim.types import Pose

OUTLINE = np.array([[-0.1, 0.05, 0], [0.1, 0.05, 0], [0.1, -0.05, 0], [-0.1, -0.05, 0]])
SETS = {
    "points": points.Config(),
    "pose_cdMc": pose.Config("cdMc"),
    "pose_cMo": pose.Config("cMo"),
    "hybrid": hybrid.Config(),
    "polar": polar.Config(),
    "segment": segment.Config(),
    "segment_n": segment.Config(normalised=True),
}
ANGLES = {"polar": slice(1, None, 2), "segment": slice(3, None, 4), "segment_n": slice(3, None, 4)}
"""Where a set has angles, which count modulo a whole turn."""


def pose_of(t, thetau):
    """The pose that a translation [m] and a rotation vector [rad] name."""
    return Pose(exp_so3(np.array(thetau, float)), np.array(t, float))


def features_of(scheme):
    """The feature set of a scheme."""
    return SETS[scheme].build(OUTLINE)


def seen_in(T_camera_object, goal=None):
    """What is seen of the reference target."""
    return sight_of(T_camera_object, OUTLINE, goal)


def without_turns(scheme, difference):
    """A difference of features, whole turns of its angles taken away."""
    if scheme not in ANGLES:
        return difference
    rest = np.array(difference)
    rest[ANGLES[scheme]] -= 2 * np.pi * np.round(rest[ANGLES[scheme]] / (2 * np.pi))
    return rest
