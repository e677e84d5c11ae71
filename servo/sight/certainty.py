"""Test whether the variances that a tracker states are small enough for servoing."""

import numpy as np

from tracking.types import Estimate, Region

# Beyond these no run counts as holding its target (servo/loop/run_measures.py): an estimate that is
# as uncertain turns the camera away from the target as often as towards it.
MOST_CENTRE = 0.5
"""Largest standard deviation of x and y, as a share of the target's size in the first picture."""
MOST_ANGLE = np.radians(20.0)
"""Largest standard deviation of the angle [rad]."""
MOST_SIZE = 0.25
"""Largest standard deviation of ln scale."""


def certain(estimate: Estimate, region: Region) -> tuple[bool, bool, bool]:
    """Return three flags: whether centre, angle and size of a tracker's estimate are certain enough
    for servoing. The standard deviation of each coordinate of the centre must be at most half the
    root of the region's area, that of the angle 20 degrees, and that of ln scale 0.25. A variance
    of nan, not stated by the tracker, counts as certain. All three are True if the tracker reports
    corners.

    Args:
        estimate: The estimate.
        region: Width and height of the target's rectangle in the first picture [px].
    """
    if estimate.corners is not None:
        return True, True, True
    x, y, angle, size = np.diagonal(estimate.covariance).tolist()
    return (
        not max(x, y) > MOST_CENTRE**2 * region.width * region.height,  # nan is not
        not angle > MOST_ANGLE**2,
        not size > MOST_SIZE**2,
    )
