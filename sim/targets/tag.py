"""An AprilTag of the family 36h11, with a white margin of one cell.

Olson 2011, "AprilTag: A robust and flexible visual fiducial system" (ICRA).
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.models.target import Target, rectangle
from sim.ranges import Length
from sim.targets._paint import box
from sim.targets.plate import THICKNESS

CELLS = 8
CELL = 32
"""Cells along a side of the black square, and their size in the picture [px]."""


@dataclass(frozen=True, slots=True)
class Config:
    """Which tag, and how large."""

    id: Annotated[int, Ge(0), Le(586)] = 0
    """Number of the tag in its family."""
    size: Length = 0.12
    """Side of its black square [m]."""

    def build(self, rng: np.random.Generator) -> Target:
        """The target; draws nothing."""
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        black = cv2.aruco.generateImageMarker(family, self.id, CELLS * CELL)
        grey = np.pad(black, CELL, constant_values=255)
        side = self.size * (CELLS + 2) / CELLS
        picture = np.repeat(grey[:, :, None], 3, axis=2).astype(np.uint8)
        spec = box((side, side, THICKNESS), (1, 1, 1, 1), picture)
        return Target(spec, rectangle(np.array([0, 0, THICKNESS]), self.size, self.size))
