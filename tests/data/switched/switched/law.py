"""Image-based or position-based, whichever error is in bounds (Gans, Hutchinson 2007)."""

from dataclasses import dataclass

import numpy as np

from servo import Command
from servo.features import points, pose


@dataclass(frozen=True, slots=True)
class Config:
    """Servos the corners until the camera is far from its goal, then the pose until a corner is
    near the side of the picture, and so on."""

    gain: float = 1.0
    """Gain of both laws [1/s]."""
    farthest: float = 1.0
    """Way of the camera from its goal at which the pose takes over [m]."""
    nearest: float = 40.0
    """Way of a corner from the side of the picture at which the corners take over [px]."""

    def build(self, rng):
        return Switched(self)


class Switched:
    def __init__(self, config):
        self._config = config

    def start(self, task):
        self._camera = task.camera
        self._points = points.Config().build(task.outline)
        self._pose = pose.Config().build(task.outline)
        self._now = self._points

    def command(self, seen, posture, dt):
        if seen is None or not seen.tilt_known:  # the pose is not measured
            return Command(np.zeros(6))
        corners = self._camera.to_pixels(seen.corners)
        sides = np.array([self._camera.width, self._camera.height]) - corners
        if np.linalg.norm(self._pose.values(seen)[:3]) > self._config.farthest:
            self._now = self._pose
        if min(corners.min(), sides.min()) < self._config.nearest:
            self._now = self._points
        error = self._now.error(self._now.values(seen), self._now.values(seen.goal))
        return Command(-self._config.gain * np.linalg.pinv(self._now.matrix(seen)) @ error)
