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
    """Poses of a robot's hand over time: positions (n, 3) [m], and orientations (n, 4) as
    continuous quaternions x, y, z, w, at the times (n,) [s] of an even grid.
    """

    times: Array
    positions: Array
    turns: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return the rotations (k, 3, 3) and the positions (k, 3) at some times (k,) [s]; outside
        of the log those at its ends.
        """
        place = np.clip((times - self.times[0]) / GRID, 0, len(self.times) - 1.001)
        low = place.astype(int)
        share = (place - low)[:, None]
        both = np.hstack([self.positions, self.turns])
        found = both[low] + share * (both[low + 1] - both[low])
        return Rotation.from_quat(found[:, 3:]).as_matrix(), found[:, :3]

    def between(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the motions (k, 3, 3), (k, 3) of the hand, seen from where it was at the times
        `begin` (k,) [s], until the times `end` (k,) [s]: T_hand-at-begin_hand-at-end.
        """
        turned, place = self.at(begin)
        turned_later, place_later = self.at(end)
        back = turned.transpose(0, 2, 1)
        return back @ turned_later, np.einsum("kij,kj->ki", back, place_later - place)

    def twists(self, begin: Array, end: Array) -> Array:
        """Return the mean twists (k, 6) of the hand between two times (k,) each, in the frame of
        the hand in the middle [m/s, rad/s].
        """
        turned, moved = self.between(begin, end)
        angles = Rotation.from_matrix(turned).as_rotvec()
        # The frame of the middle is half of the turn away.
        middle = Rotation.from_rotvec(-angles / 2).apply(moved)
        return np.hstack([middle, angles]) / (end - begin)[:, None]


def smoothed(times: Array, values: Array) -> tuple[Array, Array]:
    """Return an even grid of times (n,) [s], and the values (n, k) there of local quadratic fits to
    samples (m, k), with a triangular kernel.

    Interpolation between noisy samples would bias the clock's offset by up to 10 ms.
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
    """Return unit quaternions (n, 4) whose signs are chosen so that each is near the one before."""
    signs = np.sign(np.sum(turns[1:] * turns[:-1], axis=1))
    signs = np.append(1.0, np.cumprod(np.where(signs == 0, 1.0, signs)))
    return turns * (signs / np.linalg.norm(turns, axis=1))[:, None]


def of_poses(times: Array, poses: Array) -> RobotMotion:
    """Return the motion through poses (n, 7) on an even grid of times: position [m] and quaternion
    x, y, z, w.
    """
    return RobotMotion(times, poses[:, :3], continuous(poses[:, 3:]))


def of_twists(times: Array, twists: Array) -> RobotMotion:
    """Return the motion that begins at the identity and has twists (n, 6) in the frame of the hand
    [m/s, rad/s], on an even grid of times.
    """
    steps = GRID * (twists + np.roll(twists, 1, axis=0)) / 2
    steps[0] = 0
    turns = _products(Rotation.from_rotvec(steps[:, 3:]))
    # Half of a step's turn is behind its middle.
    halves = Rotation.from_rotvec(-steps[:, 3:] / 2)
    positions = np.cumsum((turns * halves).apply(steps[:, :3]), axis=0)
    return RobotMotion(times, positions, continuous(turns.as_quat()))


def _products(turns: Rotation) -> Rotation:
    """Return the product of the first k rotations for each k (n,), by doubling."""
    reach = 1
    while reach < len(turns):
        turns = Rotation.concatenate([turns[:reach], turns[:-reach] * turns[reach:]])
        reach *= 2
    return turns
