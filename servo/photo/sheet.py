"""The printable sheet of six AprilTags of the family 36h11 that is laid on a plane: positions of
the tags, and a figure for printing.

The sheet's frame has its origin in the sheet's middle, x to the right and y upwards.
"""

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from sim.types import Array

DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
SIDE = 0.06
"""Side of a tag's black square [m]."""
CELLS = 8
"""Cells along this side."""
MIDDLES = {
    570: (-0.055, 0.085),
    571: (0.055, 0.085),
    572: (-0.055, 0.0),
    573: (0.055, 0.0),
    574: (-0.055, -0.085),
    575: (0.055, -0.085),
}
"""Middle of each tag in the sheet's frame [m], by its number. All fit on A4 and on Letter; the
numbers are the last ones of the family but for a few, which other tags rarely have."""
PAPERS = {"a4": (0.210, 0.297), "letter": (0.2159, 0.2794)}
"""Width and height of the papers [m]."""
LARGEST = tuple(np.max([*PAPERS.values()], axis=0).tolist())
"""Width and height of a paper that covers each of them [m]."""
RULER = 0.15
"""Length of the printed ruler [m]."""
BETWEEN = 0.0425
"""Distance from the sheet's middle to the ruler above it, and to the text below it [m]."""
MM = 1e3
INCH = 0.0254
QUARTER = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) / 2
"""Corners of a square, from the upper left one clockwise, as OpenCV numbers those of a tag."""


def tag_corners(number: int) -> Array:
    """Return the corners (4, 2) of a tag's black square [m] in the sheet's frame (origin in the
    middle, x right, y up): upper left, upper right, lower right, lower left.

    Args:
        number: Number of the AprilTag, 570 to 575.

    Raises:
        KeyError: The sheet has no tag of this number.
    """
    return np.array(MIDDLES[number]) + SIDE * QUARTER


def cells_of(number: int) -> NDArray[np.bool_]:
    """Return a mask (8, 8) that is true for the white cells of the AprilTag 36h11 with this number,
    the uppermost row first; it includes the black border of one cell.
    """
    return cv2.aruco.generateImageMarker(DICTIONARY, number, CELLS) > 0


def drawn(paper: str) -> Figure:
    """Return a matplotlib figure of the sheet of AprilTags, in true size, for printing on the paper
    "a4" or "letter".
    """
    width, height = (MM * side for side in PAPERS[paper])
    figure = Figure(figsize=(width / MM / INCH, height / MM / INCH))
    ax = figure.add_axes((0, 0, 1, 1), xlim=(-width / 2, width / 2), ylim=(-height / 2, height / 2))
    ax.set_axis_off()
    for number in MIDDLES:
        _draw_tag(ax, number)
    _draw_ruler(ax)
    ax.text(
        0,
        -MM * BETWEEN,
        f"servobench photo: print at 100 %, not fitted to the page. Each black square is "
        f"{MM * SIDE:g} mm wide;\nif yours is not, give its width: --side MM. Lay the sheet flat "
        "on the plane; keep its white border.",
        ha="center",
        va="center",
        fontsize=7.5,
    )
    return figure


def _draw_tag(ax: Axes, number: int) -> None:
    """Draw the tag with a number into axes whose unit is mm."""
    left, top = MM * tag_corners(number)[0]
    cell = MM * SIDE / CELLS
    white = cells_of(number)
    ax.add_patch(_square(left, top, MM * SIDE, MM * SIDE, "black"))
    # Runs of cells along rows and along columns: a viewer shows no seam between two white cells.
    for k in range(CELLS):
        for begin, end in _runs(white[k]):
            ax.add_patch(
                _square(left + begin * cell, top - k * cell, (end - begin) * cell, cell, "white")
            )
        for begin, end in _runs(white[:, k]):
            ax.add_patch(
                _square(left + k * cell, top - begin * cell, cell, (end - begin) * cell, "white")
            )


def _square(left: float, top: float, width: float, height: float, colour: str) -> Rectangle:
    return Rectangle((left, top - height), width, height, facecolor=colour, linewidth=0)


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first index of each run of true cells, and the index after its last."""
    steps = np.diff(np.concatenate([[0], cells.astype(int), [0]]))
    ends = np.flatnonzero(steps < 0).tolist()
    return list(zip(np.flatnonzero(steps > 0).tolist(), ends, strict=True))


def _draw_ruler(ax: Axes) -> None:
    """Draw a ruler with a mark every 10 mm."""
    half = MM * RULER / 2
    height = MM * BETWEEN - 1.5
    ax.plot([-half, half], [height, height], color="black", linewidth=0.6)
    for at in np.arange(-half, half + 1, 10):
        ax.plot([at, at], [height, height + 3], color="black", linewidth=0.6)
    ax.text(0, height - 1, f"{MM * RULER:g} mm", ha="center", va="top", fontsize=8)
