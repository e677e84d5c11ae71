"""The motion of a robot's hand, as smooth poses over time, from the noisy samples of a log."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from sim.types import Array

REACH = 0.08
"""Half width of the triangular kernel of the local quadratic fit [s]."""
FEWEST = 3.5
"""Least half width, in intervals of the log, so that a quadratic has enough samples."""
GRID = 5e-3
"""Interval of the smoothed motion [s]."""
LEAST = 1e-12
"""Least determinant of a local fit; a gap in the log leaves a smaller one."""


@dataclass(frozen=True, slots=True)
class RobotMotion:
    """The motion of a robot's hand in the base's frame: positions (n, 3) [m], and orientations (n,
    4) as quaternions x, y, z, w without jumps of sign, at the times (n,) [s] of a grid of 5 ms.
    """

    times: Array
    positions: Array
    turns: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return the orientations, as matrices (k, 3, 3), and the positions (k, 3) [m] of the hand
        in the base's frame at some times (k,) [s], interpolated; outside of the log those at its
        ends.
        """
        turns, places = self._poses(times)
        return turns.as_matrix(), places

    def _poses(self, times: Array) -> tuple[Rotation, Array]:
        """Return the orientations and the positions (k, 3) [m] at some times (k,) [s]."""
        place = np.clip((times - self.times[0]) / GRID, 0, len(self.times) - 1.001)
        low = place.astype(int)
        share = (place - low)[:, None]
        turns, places = (
            each[low] + share * (each[low + 1] - each[low]) for each in (self.turns, self.positions)
        )
        return Rotation.from_quat(turns), places

    @property
    def inverse(self) -> "RobotMotion":
        """The motion of the base in the hand's frame."""
        back = self.turns * (-1, -1, -1, 1)
        return RobotMotion(self.times, -Rotation.from_quat(back).apply(self.positions), back)

    def twists(self, begin: Array, end: Array) -> Array:
        """Return the mean twists (k, 6) of the hand between two times [m/s, rad/s], linear part
        first, in the frame of the hand halfway between them.

        Args:
            begin: The earlier times (k,) [s].
            end: The later times (k,) [s].
        """
        turns, places = self._poses(begin)
        turns_later, places_later = self._poses(end)
        angles = (turns.inv() * turns_later).as_rotvec()
        # The frame of the middle is half of the turn away.
        middle = (turns * Rotation.from_rotvec(angles / 2)).inv().apply(places_later - places)
        return np.hstack([middle, angles]) / (end - begin)[:, None]


def smoothed(times: Array, values: Array) -> tuple[Array, Array]:
    """Return an even grid of times (n,) [s], 5 ms apart, and smoothed values (n, k) at these times:
    local quadratic fits with a triangular kernel, interpolated over gaps. All values are 0 if there
    are too few samples for any fit.

    Interpolation between noisy samples would bias the clock's offset by up to 10 ms.

    Args:
        times: Times of the samples (m,) in increasing order [s].
        values: The samples (m, k).
    """
    grid = np.arange(times[0], times[-1], GRID)
    reach = max(REACH, FEWEST * float(np.median(np.diff(times))))
    first, after = (np.searchsorted(times, grid + side * reach) for side in (-1, 1))
    counts = after - first
    starts = np.repeat(first - np.append(0, np.cumsum(counts)[:-1]), counts)
    columns = np.arange(counts.sum()) + starts
    away = (times[columns] - np.repeat(grid, counts)) / reach
    shape = len(grid), len(times)
    pointers = np.append(0, np.cumsum(counts))
    powers = [
        csr_array(((1 - abs(away)) * away**power, columns, pointers), shape=shape)
        for power in range(5)
    ]
    sums = np.stack([np.asarray(each.sum(axis=1)).ravel() for each in powers])
    normal = sums[np.add.outer(np.arange(3), np.arange(3))].transpose(2, 0, 1)
    known = np.linalg.det(normal) > LEAST
    if not known.any():
        return grid, np.zeros((len(grid), values.shape[1]))
    right = np.stack([each @ values for each in powers[:3]], axis=1)
    fits = np.linalg.solve(normal[known], right[known])[:, 0]
    whole = [np.interp(grid, grid[known], column) for column in fits.T]
    return grid, np.stack(whole, axis=1)


def continuous(turns: Array) -> Array:
    """Return quaternions (n, 4), scaled to length 1, with signs chosen so that each is near the one
    before; the sign of the first one stays.
    """
    signs = np.sign(np.sum(turns[1:] * turns[:-1], axis=1))
    signs = np.append(1.0, np.cumprod(np.where(signs == 0, 1.0, signs)))
    return turns * (signs / np.linalg.norm(turns, axis=1))[:, None]


def of_poses(times: Array, poses: Array) -> RobotMotion:
    """Return the motion of a hand from its poses.

    Args:
        times: Even grid of times (n,), 5 ms apart [s].
        poses: Poses (n, 7) in the base's frame: position x, y, z [m] and quaternion x, y, z, w.
    """
    return RobotMotion(times, poses[:, :3], continuous(poses[:, 3:]))


def of_twists(times: Array, twists: Array) -> RobotMotion:
    """Return the motion of a hand from its twists; it begins at the identity.

    Args:
        times: Even grid of times (n,), 5 ms apart [s].
        twists: Twists (n, 6) in the frame of the hand: vx, vy, vz [m/s], wx, wy, wz [rad/s].
    """
    steps = GRID * (twists + np.roll(twists, 1, axis=0)) / 2
    steps[0] = 0
    turns = _products(Rotation.from_rotvec(steps[:, 3:]).as_quat())
    # Half of a step's turn is behind its middle.
    halves = Rotation.from_rotvec(-steps[:, 3:] / 2)
    middles = Rotation.from_quat(turns) * halves
    positions = np.cumsum(middles.apply(steps[:, :3]), axis=0)
    return RobotMotion(times, positions, continuous(turns))


def _products(turns: Array) -> Array:
    """Return the products (n, 4) of the first 1, 2, ... n of the quaternions x, y, z, w (n, 4),
    computed in blocks, which are then joined.
    """
    side = int(np.ceil(np.sqrt(len(turns))))
    blocks = np.tile([0.0, 0.0, 0.0, 1.0], (side, side, 1))
    blocks.reshape(-1, 4)[: len(turns)] = turns
    for k in range(1, side):
        blocks[:, k] = _product(blocks[:, k - 1], blocks[:, k])
    for k in range(1, side):
        blocks[k] = _product(blocks[k - 1, -1], blocks[k])
    return blocks.reshape(-1, 4)[: len(turns)]


def _product(one: Array, other: Array) -> Array:
    """Return the products (k, 4) of the quaternions x, y, z, w of two arrays (k, 4)."""
    u, v = one[..., :3], other[..., :3]
    s, t = one[..., 3:], other[..., 3:]
    vector = s * v + t * u + np.cross(u, v)
    return np.concatenate([vector, s * t - (u * v).sum(axis=-1, keepdims=True)], axis=-1)
