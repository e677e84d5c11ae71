"""The reference rectangle of a target: its sides [m] and area [m^2], and the area of any convex
quadrangle.
"""

from dataclasses import dataclass

import numpy as np

from sim.types import Array


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """The reference rectangle, which stands for a target in measurements and control: a level
    rectangle, given by its corners (4, 3) in the target's frame [m]: rear left, front left, front
    right, rear right.

    >>> corners = np.array([[-0.1, 0.05, 0.03], [0.1, 0.05, 0.03], [0.1, -0.05, 0.03],
    ...                     [-0.1, -0.05, 0.03]])
    >>> outline = Outline(corners)
    >>> outline.length, outline.width, outline.height
    (0.2, 0.1, 0.03)
    """

    corners: Array
    """Corners (4, 3) in the target's frame [m], clockwise as seen from above, the rear left one
    first: the nose points along x, and y points to the left."""

    @property
    def length(self) -> float:
        """Length of the rectangle along the target's nose, its x axis [m]."""
        return float(np.ptp(self.corners[:, 0]))

    @property
    def width(self) -> float:
        """Length of the rectangle across the target's nose, along its y axis [m]."""
        return float(np.ptp(self.corners[:, 1]))

    @property
    def height(self) -> float:
        """Height of the rectangle over the table [m]: z of its corners in the target's frame."""
        return float(self.corners[0, 2])

    @property
    def area(self) -> float:
        """Area of the rectangle [m^2]: length times width."""
        return self.length * self.width


def area(corners: Array) -> float:
    """Return the area of a convex quadrangle, in the square of the unit of its corners (4, 2) or
    (4, 3), of which only x and y count: half the product of the lengths of its diagonals and of the
    sine of the angle between them.

    >>> area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]))
    2.0
    """
    a, b, c, d = corners[:, :2].tolist()
    return abs((c[0] - a[0]) * (d[1] - b[1]) - (c[1] - a[1]) * (d[0] - b[0])) / 2
