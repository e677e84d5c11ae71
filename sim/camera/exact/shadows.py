"""Soft shadows under the things on a table, as under a sky that is bright everywhere: an ellipse
below each thing, dark in the middle and without an edge.

The sums are IEEE arithmetic in a fixed order, so that the same scene gives the same bits on every
machine.
"""

from dataclasses import dataclass
from math import ceil, sqrt

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array, Image

DARKEST = 0.6
"""Share of the light that is missing in the middle of a shadow."""
WIDTH = 1.8
"""Radii of a shadow relative to half the thing's width."""
FLAT = 0.3
"""Height of a thing, relative to half its width, from which on its shadow is darkest."""
NEAREST = 0.01
"""If a corner of a shadow's bounding rectangle is nearer along the optical axis than this [m], all
pixels of the picture are looked at."""


@dataclass(frozen=True, slots=True)
class Things:
    """The things of a MuJoCo model that may cast a shadow, each as a box: every body but the world,
    with a box around its geoms, and every geom of the world.
    """

    frames: NDArray[np.int64]
    """Id of the body, or of the world's geom (n,)."""
    is_body: NDArray[np.bool_]
    middles: Array
    """Middle of each box in the frame of its body or geom (n, 3) [m]."""
    halves: Array
    """Half the sides of each box (n, 3) [m]."""

    @staticmethod
    def of(model: mujoco.MjModel, drawn: NDArray[np.bool_]) -> "Things":
        """Return the things of a model.

        Args:
            model: The scene.
            drawn: Flags (ngeom,): True for each geom that is drawn and casts a shadow.
        """
        boxes: dict[tuple[bool, int], list[Array]] = {}
        for geom in np.flatnonzero(drawn).tolist():
            body = int(model.geom_bodyid[geom])
            middle, half = np.split(model.geom_aabb[geom], 2)
            if body == 0:
                boxes[False, geom] = [middle - half, middle + half]
                continue
            turn = np.empty(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            rotation = turn.reshape(3, 3)
            place = model.geom_pos[geom] + rotation @ middle
            reach = abs(rotation) @ half
            boxes.setdefault((True, body), []).extend([place - reach, place + reach])
        low, high = (
            np.array([end(corners, axis=0) for corners in boxes.values()]).reshape(-1, 3)
            for end in (np.min, np.max)
        )
        return Things(
            np.array([frame for _, frame in boxes], np.int64),
            np.array([is_body for is_body, _ in boxes], bool),
            (low + high) / 2,
            (high - low) / 2,
        )

    def places(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Return the rotations (n, 3, 3) and middles (n, 3) [m] of the boxes in the world, in
        MuJoCo's state `data`.
        """
        turns = np.empty((len(self.frames), 3, 3))
        origins = np.empty((len(self.frames), 3))
        for of, matrices, places in (
            (self.is_body, data.xmat, data.xpos),
            (~self.is_body, data.geom_xmat, data.geom_xpos),
        ):
            turns[of] = matrices[self.frames[of]].reshape(-1, 3, 3)
            origins[of] = places[self.frames[of]]
        return turns, origins + (turns * self.middles[:, None]).sum(axis=2)


@compiled(error_model="numpy")
def _shade(
    image: Image,
    shown: NDArray[np.int16],
    table: int,
    half: Array,
    rotation: Array,
    middle: Array,
    turn: Array,
    eye: Array,
    view: Array,
) -> None:
    """Darken the table below one thing."""
    # The shadow of the box's inscribed ellipsoid on the table: x' (a b; b c)^-1 x < 1.
    a = b = c = tall = 0.0
    for k in range(3):
        a += (rotation[0, k] * half[k]) ** 2
        b += rotation[0, k] * rotation[1, k] * half[k] ** 2
        c += (rotation[1, k] * half[k]) ** 2
        tall += abs(rotation[2, k]) * half[k]
    area = a * c - b * b
    size = sqrt(sqrt(max(area, 0.0)))
    gap = max(middle[2] - tall, 0.0)
    if middle[2] + tall <= 0.0 or gap >= size or eye[2] <= 0.0:
        return
    strength = DARKEST * min(1.0, 2.0 * tall / (FLAT * size)) * (1.0 - gap / size)
    height, width = shown.shape
    left = top = np.inf
    right = low = -np.inf
    for i in range(4):
        x = middle[0] + WIDTH * sqrt(a) * (2 * (i % 2) - 1) - eye[0]
        y = middle[1] + WIDTH * sqrt(c) * (2 * (i // 2) - 1) - eye[1]
        depth = turn[0, 2] * x + turn[1, 2] * y - turn[2, 2] * eye[2]
        if depth < NEAREST:
            left = top = 0.0
            right = width + 0.0
            low = height + 0.0
            break
        u = view[0] * (turn[0, 0] * x + turn[1, 0] * y - turn[2, 0] * eye[2]) / depth + view[2]
        v = view[1] * (turn[0, 1] * x + turn[1, 1] * y - turn[2, 1] * eye[2]) / depth + view[3]
        left = min(left, u)
        right = max(right, u)
        top = min(top, v)
        low = max(low, v)
    scale = WIDTH * WIDTH * area
    for row in range(int(max(top, 0.0)), int(min(ceil(low), height + 0.0))):
        q = (row + 0.5 - view[3]) / view[1]
        for column in range(int(max(left, 0.0)), int(min(ceil(right), width + 0.0))):
            if shown[row, column] != table:
                continue
            p = (column + 0.5 - view[2]) / view[0]
            # Where the ray through the pixel meets the table.
            reach = -eye[2] / (turn[2, 0] * p + turn[2, 1] * q + turn[2, 2])
            x = eye[0] + reach * (turn[0, 0] * p + turn[0, 1] * q + turn[0, 2]) - middle[0]
            y = eye[1] + reach * (turn[1, 0] * p + turn[1, 1] * q + turn[1, 2]) - middle[1]
            inside = 1.0 - (c * x * x - 2.0 * b * x * y + a * y * y) / scale
            if inside > 0.0:
                left_over = 65536 - int(65536.0 * strength * inside * inside)
                for k in range(3):
                    image[row, column, k] = (image[row, column, k] * left_over + 32768) >> 16


@compiled(error_model="numpy")
def shade(
    image: Image,
    shown: NDArray[np.int16],
    table: int,
    halves: Array,
    rotations: Array,
    middles: Array,
    turn: Array,
    eye: Array,
    view: Array,
) -> None:
    """Darken the table in a picture below the things on it. The table's top is the plane z = 0. A
    shadow gets weaker with the gap between thing and table, and vanishes where the gap is half the
    thing's width.

    Args:
        image: The picture, RGB (H, W, 3), written.
        shown: Number of the geom that each pixel shows (H, W).
        table: Number of the table.
        halves: Half the sides of the things' boxes (n, 3) [m].
        rotations: Rotations of these boxes in the world (n, 3, 3).
        middles: Middles of these boxes in the world (n, 3) [m].
        turn: Rotation of the camera in the world (3, 3).
        eye: Place of the camera in the world (3,) [m].
        view: Focal lengths fx, fy and principal point cx, cy (4,) [px].
    """
    for i in range(len(halves)):
        _shade(image, shown, table, halves[i], rotations[i], middles[i], turn, eye, view)
