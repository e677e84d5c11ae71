"""Example of custom features: centre of the target in the image, and logarithm of its size."""

from dataclasses import dataclass

import numpy as np

import servo


@dataclass(frozen=True)
class Config:
    """Settings of the feature set; there are none."""

    def build(self, outline):
        """Return the feature set, which is the same for any target; `outline` is not used."""
        return CentreAndSize()


class CentreAndSize:
    """Feature set s = (x, y, ln a): the target's centre in normalised image coordinates, and the
    logarithm of a, the square root of its area there.
    """

    names = ("x", "y", "ln a")
    units = ("1", "1", "1")
    noise = np.array([2e-4, 2e-4, 2e-3])
    feed_forward = ("x", "y")
    sole_dof = {"ln a": "vz"}

    def values(self, sight):
        """Return the features s (3,) of the target as it is seen (`Sight`): its centre x, y in
        normalised image coordinates, and ln a, with a the square root of its area there.
        """
        m = sight.moments
        return np.array([m.xg, m.yg, np.log(m.area) / 2])

    def matrix(self, sight):
        """Return the interaction matrix L (3, 6) of the features for a target at rest that is small
        and parallel to the image: ds/dt = L v for a camera twist v (6,) in the camera frame [m/s,
        rad/s].
        """
        x, y, _ = self.values(sight)
        near = sight.plane.C  # 1 / Z
        rows = [-near, 0, x * near, x * y, -1 - x * x, y]
        columns = [0, -near, y * near, 1 + y * y, -x * y, -x]
        return np.array([rows, columns, [0, 0, near, 1.5 * y, -1.5 * x, 0]])

    def error(self, values, goal):
        """Return the feature error e = s - s* (3,) of the features `values` against those at the
        goal.
        """
        return values - goal

    def known(self, sight):
        """Return a flag (3,) for each feature, True if it is measured: those of the centre always,
        ln a if the tracker measures the target's size.
        """
        return np.array([True, True, sight.size_known])

    def scales(self, goal):
        """Return the divisors (3,) of the features' errors for the estimator, which are ones."""
        return np.ones(3)


start = {"x": 60.0, "scale": 1.2}
result = servo.simulate("still", features=Config, start=start, duration=2.0)
print(f"{result.outcome.name}, {result[-1].servo_error:.2f} px from the goal")
