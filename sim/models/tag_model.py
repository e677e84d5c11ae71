"""The model of an AprilTag of the family 36h11, with a white margin of one cell.

Olson 2011, "AprilTag: A robust and flexible visual fiducial system" (ICRA).
"""

import cv2
import numpy as np

from sim.marker import Marker
from sim.models.paint import THIN, box
from sim.models.target import Target, rectangle

CELLS = 8
CELL = 32
"""Cells along a side of the black square, and their size in the picture [px]."""


def tag_target(marker: Marker) -> Target:
    """Return the target that is an AprilTag lying on z = 0, the right side of its pattern at +x,
    the target's nose. Its reference rectangle, which stands for it in measurements and control, is
    the black square.
    """
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    black = cv2.aruco.generateImageMarker(family, marker.id, CELLS * CELL)
    grey = np.pad(black, CELL, constant_values=255)
    side = marker.size * (CELLS + 2) / CELLS
    picture = np.repeat(grey[:, :, None], 3, axis=2).astype(np.uint8)
    spec = box((side, side, THIN), (1, 1, 1, 1), picture)
    return Target(spec, rectangle(np.array([0, 0, THIN]), marker.size, marker.size))
