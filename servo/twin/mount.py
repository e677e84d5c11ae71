"""The mount of the camera on the hand, the clock's offset and the plane of the scene, from points
that were followed through a film and from the hand's motion.

For a pair of pictures with the hand's motion R_f, t_f between them, a mount R, r and the plane
n . X = 1 of the scene in the first camera, a point x~ = (x, y, 1) is seen again at the ray
a - (n . x~) b, with R_c = R^T R_f R, t_c = R^T (t_f + R_f r - r), a = R_c^T x~, b = R_c^T t_c. The
residual is linear in n, which each pair has of its own, near a common one: it is solved for in each
step (variable projection), and the rest by Gauss and Newton's method with Cauchy weights. Intervals
are those of the sandwich estimate over blocks of 1 s.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from servo.twin.offset import LEVEL, regressors
from servo.twin.robot_motion import RobotMotion
from servo.twin.tracks import Tracks
from sim.geometry import exp_so3
from sim.types import Array, Pose

BLOCK = 1.0
"""Length of the blocks of the sandwich estimate [s]."""
SCALES = 3.0, 1.5, 0.8, 0.5, 0.3, 0.3, 0.3, 0.3
"""Cauchy scale of each step [px]."""
LAST = 0.3
"""Cauchy scale of the cost [px]."""
FREE_PLANE = 0.02
"""Standard deviation of each component of a pair's own plane n from the common one's, relative to
the third component of the latter (1 / depth)."""
WEAKLY = np.array([0.2, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.2, 0.01, 1.0, 1.0, 1.0])
"""Standard deviation of a weak prior of offset [s], rotation [rad], lever [m], log focal length,
drift and turn [rad], so that a direction that no motion shows stays where it is."""
FLOORS = np.array([3e-4, *3 * [np.radians(0.15)], *3 * [3e-3], 5e-3, 2e-5, *3 * [np.radians(0.15)]])
"""Added to half of each interval: errors of the method that no recording shows."""
SMALL = 1e-5, *7 * [1e-4], 1e-6, *3 * [1e-4]
"""Steps of the numeric derivatives."""
MOST = 250_000
"""Largest number of points of a fit; of more, each k-th is taken."""
LEVER_ALONG = 6
FOCAL = 7
DRIFT = 8
TURN = 9, 10, 11
"""Places of the lever along the optical axis, of the focal length, of the drift and of the turn
among the parameters."""
TIMED = 0, DRIFT
"""Places of the parameters on which the times of the pictures depend."""
COUNT = 12
"""Number of parameters."""
FARTHEST = 1e4
"""Largest depth that a plane is given [m]."""


@dataclass(frozen=True, slots=True)
class Mount:
    """The mount of a camera on a robot's hand (its pose in the hand's frame), with the offset of
    the film's clock, the focal length and the plane of the scene; estimates have 95 % intervals
    (`halves`).
    """

    offset: float
    """A picture with the stamp t was taken at t + offset on the log's clock [s]."""
    rotation: Array
    """R_hand_camera (3, 3)."""
    arm: Array
    """Position of the camera from the hand's origin, along the camera's own axes (3,) [m]."""
    focal: float
    """True over given focal length."""
    drift: float
    """Change of the offset over time [s/s]; the offset itself is that in the film's middle."""
    plane: Array
    """n (3,) of the common plane n . X = 1 in the camera's frame [1/m]."""
    halves: Array
    """Half intervals (12,): offset [s], rotation [rad] and lever [m] along the camera's axes, log
    focal length, drift [s/s], turn [rad]; 0 for what was not estimated."""
    cost: float
    """Mean of the Cauchy cost over the points, with a scale of 0.3 px."""
    scatter: float
    """Spread of the pairs' own planes over the common one: large where no plane fits."""
    off: float
    """Median distance of the points from where the fit has them [px]."""
    stray: float
    """Share of the points that are off the fit by more than 2 px and by more than five times the
    median `off`: they are on things that move."""
    turn: Array = field(default_factory=lambda: np.eye(3))
    """Rotation (3, 3) of the frame of the hand's orientation in that of its position; the identity
    in a log that is right."""

    @property
    def lever(self) -> Array:
        """Position of the camera in the frame of the robot's hand (3,) [m]."""
        return self.rotation @ self.arm

    @property
    def depth(self) -> float:
        """Distance from the camera to the plane of the scene along the optical axis [m]; 10 km for
        a plane that is farther away or behind the camera.
        """
        return 1 / max(float(self.plane[2]), 1 / FARTHEST)


def camera_poses(motion: RobotMotion, mount: Mount, times: Array) -> list[Pose]:
    """Return the poses of the camera in the frame of the robot's base, T_base_camera [m], at given
    times.

    Args:
        motion: Motion of the robot's hand in the base's frame.
        mount: Pose of the camera in the hand.
        times: The times (n,) on the log's clock [s].
    """
    turns, places = motion.at(times)
    return [
        Pose(turn @ mount.rotation, place + turn @ mount.lever)
        for turn, place in zip(turns, places, strict=True)
    ]


def turn_of(motion: RobotMotion, steps: Tracks, flows: Array, offset: float) -> Array:
    """Return the orientation (3, 3) of the frame in which the log has the angular part of the
    hand's twists, in the frame in which it has the linear part. It comes in closed form from the
    regression of the affine flows on the twists at an offset [s]; it is the identity if the hand
    does not slide or does not turn.
    """
    of_slides, of_turns, _ = _regression(motion, steps, flows, offset)
    return _rotation(of_slides.T @ of_turns)


def _rotation(matrix: Array) -> Array:
    """Return the rotation (3, 3) that is nearest to a matrix (3, 3)."""
    U, _, Vt = np.linalg.svd(matrix)
    return np.asarray(U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt, np.float64)


def start(
    motion: RobotMotion, steps: Tracks, flows: Array, offset: float, along: float = 0.0
) -> Mount:
    """Return a rough mount to begin a fit with, from a linear regression of the pictures' motion on
    the hand's twists. It has no intervals, and its fit has an infinite cost.

    Args:
        motion: The hand's motion.
        steps: Points that were followed between consecutive pictures.
        flows: Affine flows (p, 6) of these pairs of pictures [1/s], from `affine_flows`.
        offset: Offset of the film's clock, to be added to the film's times [s].
        along: Distance from the hand's origin to the camera along the optical axis [m].
    """
    of_slides, of_turns, spread = _regression(motion, steps, flows, offset)
    density = float(np.cbrt(np.linalg.det(of_slides)))
    # Where the hand hardly slides, or turns, the other part alone decides.
    share = np.linalg.norm(spread[:3]) > 0.1 * np.linalg.norm(spread[3:])
    slide_part = of_slides / density if share and abs(density) > 1e-6 else np.zeros((3, 3))
    turn_part = of_turns if np.linalg.norm(spread[3:]) > 1e-3 else np.zeros((3, 3))
    back = _rotation(slide_part + turn_part)
    size = float(np.linalg.norm(of_slides) / np.sqrt(3))
    n0 = np.array([0.0, 0.0, np.clip(size, 1 / FARTHEST, 1e3)])
    nothing = np.zeros(COUNT)
    arm = np.array([0.0, 0.0, along])
    return Mount(offset, back.T, arm, 1.0, 0.0, n0, nothing, np.inf, np.inf, np.inf, 0.0)


def _regression(
    motion: RobotMotion, steps: Tracks, flows: Array, offset: float
) -> tuple[Array, Array, Array]:
    """Return the matrices (3, 3) by which the hand's slides, and its turns, move the picture, from
    the robust regression of the affine flows on its twists, and the twists' spread (6,).
    """
    points = (steps.before + steps.after)[steps.known] / 2
    wide, high = 1 + (points**2).mean(axis=0)
    u0, u_x, u_y, v0, v_x, v_y = flows.T
    slides = np.stack([-u0, -v0, (u_x + v_y) / 2], axis=1)
    turns = np.stack([v0 / high, -u0 / wide, (u_y - v_x) / 2], axis=1)
    known = regressors(motion, steps, offset)
    weights = np.ones(len(known))
    fit = np.zeros((7, 6))
    both = np.hstack([slides, turns])
    for _ in range(3):
        rows = known * weights[:, None]
        found = np.linalg.lstsq(rows, both * weights[:, None], rcond=1e-9)[0]
        fit = np.asarray(found, np.float64)
        away = np.linalg.norm(both - known @ fit, axis=1)
        weights = 1 / (1 + away / max(float(np.median(away)), 1e-9))
    return fit[1:4, :3].T, fit[4:, 3:].T, known[:, 1:].std(axis=0)


def fitted(
    motion: RobotMotion,
    tracks: Tracks,
    first: Mount,
    fixed: tuple[int, ...] = (FOCAL, DRIFT, *TURN),
    scales: tuple[float, ...] = SCALES,
) -> Mount:
    """Return the mount of the camera that fits the followed points best, with 95 % intervals,
    beginning with a rough one. If no picture is inside the log's time, return the rough one with an
    infinite cost.

    Args:
        motion: The hand's motion.
        tracks: Points that were followed through the film.
        first: The mount to begin with.
        fixed: Numbers of the parameters that stay: 0 offset, 1 to 3 rotation, 4 to 6 position of
            the camera (6: along the optical axis), 7 focal length, 8 drift of the clock, 9 to 11
            turn between the linear and the angular part of the twists.
        scales: Cauchy scale of each step of the fit [px].
    """
    every = max(1, round(tracks.known.sum() / MOST))
    begin = tracks.times[tracks.first] + first.offset
    inside = (begin > motion.times[0]) & (begin < motion.times[-1])
    tracks = tracks.only(inside, every)
    if not len(tracks.first):
        return replace(first, cost=np.inf)
    free = np.setdiff1d(np.arange(COUNT, dtype=np.int64), fixed)
    now = first
    for scale in scales:
        normal, scores, _ = _system(motion, tracks, now, free, scale)
        step = np.linalg.solve(normal, scores.sum(axis=0))
        now = _moved(now, step, free)
    return _with_intervals(motion, tracks, now, free)


def _moved(mount: Mount, step: Array, free: NDArray[np.int64]) -> Mount:
    """Return a mount after a step (k + 3,) of the k free parameters, limited to 0.3 each (the
    offset to 0.05 s), and of the plane.
    """
    whole = np.zeros(COUNT)
    whole[free] = np.clip(step[:-3], -0.3, 0.3)
    return replace(
        mount,
        offset=mount.offset + float(np.clip(whole[0], -0.05, 0.05)),
        rotation=mount.rotation @ exp_so3(whole[1:4]),
        arm=mount.arm + whole[4:7],
        focal=mount.focal * float(np.exp(whole[FOCAL])),
        drift=mount.drift + whole[DRIFT],
        turn=mount.turn @ exp_so3(whole[list(TURN)]),
        plane=mount.plane + step[-3:],
    )


@dataclass(frozen=True, slots=True)
class _Moves:
    """How the hand moved from the first to the second picture of each of p pairs: its rotation (p,
    3, 3) in its own frame at the first picture (`turned`), the orientation (p, 3, 3) of the base in
    that frame (`back`), and its displacement (p, 3) in the base's frame [m] (`slid`).
    """

    turned: Array
    back: Array
    slid: Array

    @staticmethod
    def of(motion: RobotMotion, tracks: Tracks, mount: Mount) -> "_Moves":
        """Return the motion of the hand at the offset and drift of a mount."""
        middle = (tracks.times[0] + tracks.times[-1]) / 2
        times = tracks.times + mount.offset + mount.drift * (tracks.times - middle)
        turns, places = motion.at(times[tracks.first])
        turns_later, places_later = motion.at(times[tracks.second])
        back = turns.transpose(0, 2, 1)
        return _Moves(back @ turns_later, back, places_later - places)


def _rays(moves: _Moves, tracks: Tracks, mount: Mount) -> tuple[Array, Array, Array, Array]:
    """Return the parts of the residuals c - f (n . x~), where n is the plane: c (p, m, 2) [px], f
    (p, m, 2) [px m] and x~ (p, m, 3); and the weights (p, m), 0 for a missing point, else 1.
    """
    turned = moves.turned
    moved = np.einsum("pij,pj->pi", moves.back, moves.slid @ mount.turn)
    R = mount.rotation
    r = mount.lever
    turn = R.T @ turned @ R
    slide = (moved + turned @ r - r) @ R
    before = np.insert(tracks.before / mount.focal, 2, 1.0, axis=2)
    after = tracks.after / mount.focal
    a = before @ turn
    b = np.einsum("pi,pij->pj", slide, turn)[:, None]
    # In pixels of the film: a longer focal length must not make residuals smaller.
    pixels = tracks.focal * mount.focal
    constant = pixels * (a[..., :2] - after * a[..., 2:])
    factor = pixels * (b[..., :2] - after * b[..., 2:])
    return constant, factor, before, tracks.known.astype(float)


def _planes(
    constant: Array, factor: Array, before: Array, weights: Array, plane: Array, ridge: Array
) -> tuple[Array, Array, Array]:
    """Return the planes (p, 3) of the pairs, the negative derivatives (p, 2m, 3) of the residuals
    by them, and the inverses (p, 3, 3) of their normal matrices.
    """
    pairs, points = constant.shape[:2]
    by_plane = (factor[..., None] * before[:, :, None]).reshape(pairs, 2 * points, 3)
    heavy = np.repeat(weights, 2, axis=1)[..., None]
    normal = by_plane.transpose(0, 2, 1) @ (heavy * by_plane) + ridge
    left = constant.reshape(pairs, 2 * points, 1) - by_plane @ plane[:, None]
    inverse = np.linalg.inv(normal)
    own = plane + (inverse @ (by_plane.transpose(0, 2, 1) @ (heavy * left)))[..., 0]
    return own, by_plane, np.asarray(inverse, np.float64)


def _residuals(
    moves: _Moves, tracks: Tracks, mount: Mount, scale: float
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return the residuals (p, 2m) [px], their Cauchy weights (p, m), the three results of
    `_planes`, and the ridge (3, 3) that pulls each pair's plane to the common one.
    """
    constant, factor, before, known = _rays(moves, tracks, mount)
    ridge = np.eye(3) / (FREE_PLANE * max(abs(mount.plane[2]), 1e-4)) ** 2 * scale**2
    # The weights follow the common plane first, then each pair's own.
    left = constant - factor * (before @ mount.plane)[..., None]
    weights = known / (1 + (np.linalg.norm(left, axis=2) / (2 * scale)) ** 2)
    own, by_plane, inverse = _planes(constant, factor, before, weights, mount.plane, ridge)
    flat = constant.reshape(by_plane.shape[:2])
    left = flat - (by_plane @ own[..., None])[..., 0]
    away = np.linalg.norm(left.reshape(constant.shape), axis=2)
    weights = known / (1 + (away / scale) ** 2)
    own, by_plane, inverse = _planes(constant, factor, before, weights, mount.plane, ridge)
    left = flat - (by_plane @ own[..., None])[..., 0]
    return left, weights, own, by_plane, inverse, ridge


def _system(
    motion: RobotMotion, tracks: Tracks, mount: Mount, free: NDArray[np.int64], scale: float
) -> tuple[Array, Array, Array]:
    """Return the normal matrix (k + 3, k + 3) of the k free parameters and the plane, the negative
    gradient of each pair (p, k + 3), and the planes (p, 3).
    """
    moves = _Moves.of(motion, tracks, mount)
    left, weights, own, by_plane, inverse, ridge = _residuals(moves, tracks, mount, scale)
    heavy = np.repeat(weights, 2, axis=1)[..., None]
    columns = []
    for place in free:
        step = np.zeros(len(free) + 3)
        step[np.flatnonzero(free == place)] = SMALL[place]
        other = _moved(mount, step, free)
        later = _Moves.of(motion, tracks, other) if place in TIMED else moves
        constant, factor, before, _ = _rays(later, tracks, other)
        seen = np.einsum("pmi,pi->pm", before, own)
        there = constant - factor * seen[..., None]
        columns.append((there.reshape(left.shape) - left) / SMALL[place])
    J = np.stack(columns, axis=2)
    k = len(free)
    cross = J.transpose(0, 2, 1) @ (heavy * by_plane)
    # A step of the plane moves the centre of the ridge: the other part of the residuals.
    to_ridge = np.concatenate([-cross, -np.broadcast_to(ridge, (len(own), 3, 3))], axis=1)
    gradient = (J.transpose(0, 2, 1) @ (heavy * left[..., None]))[..., 0]
    pull = (own - mount.plane) @ ridge
    scores = np.concatenate([-gradient, pull], axis=1)
    normal = np.zeros((k + 3, k + 3))
    normal[:k, :k] = np.einsum("pji,pjk->ik", J, heavy * J)
    normal[k:, k:] = len(own) * ridge
    normal -= np.einsum("pij,pjk,plk->il", to_ridge, inverse, to_ridge)
    prior = np.zeros(k + 3)
    prior[:k] = (scale / WEAKLY[free]) ** 2
    return normal + np.diag(prior + 1e-9), scores, own


def _with_intervals(
    motion: RobotMotion, tracks: Tracks, mount: Mount, free: NDArray[np.int64]
) -> Mount:
    """Return a mount with its intervals and measures of fit."""
    normal, scores, own = _system(motion, tracks, mount, free, LAST)
    left, weights, *_ = _residuals(_Moves.of(motion, tracks, mount), tracks, mount, LAST)
    blocks = (tracks.times[tracks.first] // BLOCK).astype(int)
    blocks -= blocks.min()
    sums = np.stack([np.bincount(blocks, column) for column in scores.T], axis=1)
    inverse = np.linalg.inv(normal)
    count = int(np.count_nonzero(np.bincount(blocks)))
    freedom = max(count - len(normal), 1)
    # Cauchy's weights bend: the curvature is a half of the normal matrix where noise is normal.
    spread = inverse @ (sums.T @ sums) @ inverse * count / freedom
    halves = np.zeros(COUNT)
    own_halves = np.sqrt(np.maximum(np.diag(spread)[:-3], 0))
    prior = np.sqrt(np.diag(inverse)[:-3]) * LAST
    halves[free] = float(student.ppf((1 + LEVEL) / 2, freedom)) * np.maximum(own_halves, prior)
    halves[free] += FLOORS[free]
    away = np.linalg.norm(left.reshape(*weights.shape, 2), axis=2)[tracks.known]
    middle = float(np.median(away))
    spread_of_planes = np.subtract(*np.quantile(own[:, 2], [0.84, 0.16])) / 2
    return replace(
        mount,
        halves=halves,
        cost=float(np.mean(np.log1p((away / LAST) ** 2))),
        scatter=float(spread_of_planes / max(abs(mount.plane[2]), 1e-9)),
        off=middle,
        stray=float(np.mean(away > max(2.0, 5 * middle))),
    )
