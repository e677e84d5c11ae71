"""A simulated depth sensor, which gives exact depth pictures a limited range, noise and holes."""

from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.camera.camera import CameraConfig
from sim.types import DepthPicture

JUMP = 1.03
"""Largest ratio of the greatest to the least depth in a block of 3 x 3 pixels without an edge.
Chosen by hand: a plane that is tilted by 75 degrees stays below it (f = 290 px), and an object that
is 4 cm high, on a table at 1 m, exceeds it.
"""
AROUND = np.ones((3, 3), np.uint8)
"""The neighbours of a pixel between which a jump in depth is an edge."""


@final
class DepthSensor:
    """A simulated depth sensor: turns exact depth pictures [m] into those that a sensor with noise,
    holes at edges and a limited range would measure, as the camera's settings `config` say; `rng`
    draws the noise.
    """

    def __init__(self, config: CameraConfig, rng: np.random.Generator) -> None:
        """Store the settings of the camera; `rng` draws the noise of the depths."""
        self._config = config
        self._rng = rng

    def develop(self, exact: DepthPicture) -> DepthPicture:
        """Return the depth picture, float32 (H, W) [m], that the sensor measures, given the exact
        depths (H, W) [m]; the result is read-only. It is nan where no surface is (an exact depth of
        inf), where the measured depth, with its noise, is outside the sensor's range, and within
        `depth_holes` px of an edge between near and far.

        The noise of a depth z has the standard deviation `depth_noise` z^2: that of a triangulation
        whose disparity has a constant noise (Khoshelham and Elberink 2012, Accuracy and resolution
        of Kinect depth data for indoor mapping applications, Sensors 12(2)).
        """
        c = self._config
        depth = np.where(np.isfinite(exact), exact, np.float32(np.nan))
        if c.depth_noise > 0:
            drawn = self._rng.standard_normal(exact.shape, np.float32)
            depth += np.float32(c.depth_noise) * depth**2 * drawn
        # The sensor's range is that of what it measures, which noise can make negative.
        has_none = (depth <= 0) | (depth < c.depth_nearest) | (depth > c.depth_farthest)
        if c.depth_holes > 0:
            has_none |= _beside_edges(exact, c.depth_holes)
        depth[has_none] = np.nan
        depth.setflags(write=False)
        return depth


def _beside_edges(exact: DepthPicture, pixels: int) -> NDArray[np.bool_]:
    """Return a mask (H, W), True for the pixels of an exact depth picture that are at most `pixels`
    away from an edge in depth.
    """
    edges = cv2.dilate(exact, AROUND) / JUMP > cv2.erode(exact, AROUND)
    size = 2 * pixels - 1
    return cv2.dilate(edges.astype(np.uint8), np.ones((size, size), np.uint8)).astype(bool)
