"""The centroid as features, and a proportional law that moves the camera sideways only."""

from dataclasses import dataclass

import numpy as np

from servo import Command


@dataclass(frozen=True, slots=True)
class Centre:
    """The centroid in normalised image coordinates."""

    def build(self, outline):
        return CentreFeatures()


class CentreFeatures:
    names, units = ("xg", "yg"), ("1", "1")
    noise, feed_forward, sole_dof = np.full(2, 1e-4), ("xg", "yg"), {}

    def values(self, sight):
        return np.array([sight.moments.xg, sight.moments.yg])

    def matrix(self, sight):
        """Chaumette 2004, equation 22: the centroid of a dense region in a plane."""
        m, A, B, C = sight.moments, sight.plane.A, sight.plane.B, sight.plane.C
        n20, n11, n02 = 4 * m.mu20 / m.area, 4 * m.mu11 / m.area, 4 * m.mu02 / m.area
        x, y = m.xg, m.yg
        inverse_depth = A * x + B * y + C
        return np.array(
            [
                [
                    -inverse_depth,
                    0,
                    x * inverse_depth + A * n20 + B * n11,
                    x * y + n11,
                    -(1 + x * x + n20),
                    y,
                ],
                [
                    0,
                    -inverse_depth,
                    y * inverse_depth + A * n11 + B * n02,
                    1 + y * y + n02,
                    -(x * y + n11),
                    -x,
                ],
            ]
        )

    def error(self, values, goal):
        return values - goal

    def known(self, sight):
        return np.array([True, True])

    def scales(self, goal):
        return np.ones(2)


@dataclass(frozen=True, slots=True)
class Straight:
    """Moves the camera parallel to the table, proportionally to the error."""

    gain: float = 2.0
    """Gain [1/s]."""

    def build(self, rng):
        return StraightLaw(self)


class StraightLaw:
    def __init__(self, config):
        self._config = config

    def start(self, task):
        self._features = task.features

    def command(self, seen, posture, dt):
        twist = np.zeros(6)
        if seen is not None:
            error = self._features.error(*map(self._features.values, (seen, seen.goal)))
            matrix = self._features.matrix(seen)[:, :2]
            twist[:2] = -self._config.gain * np.linalg.pinv(matrix) @ error
        return Command(twist)
