"""Rotations SO(3) and rigid motions SE(3): exponentials, logarithms, adjoints, angles, and poses
from roll, pitch and yaw; inverses of matrices.

A twist is (v, w): linear velocity first [m/s], then angular velocity [rad/s], both in the moving
frame.
"""

# pyright: reportAttributeAccessIssue=false
# LAPACK's functions come from a compiled module without stubs.
from collections.abc import Sequence
from math import atan2, cos, isfinite, radians, sin, sqrt, tan

import numpy as np
from scipy.linalg import lapack

from sim.types import Array, Pose

IDENTITY = np.eye(3)
VISION_FROM_MUJOCO = np.diag([1.0, -1.0, -1.0])
"""Rotation between a camera's frame in computer vision (x right, y down, z forward) and in MuJoCo
(x right, y up, z back)."""
SMALL_ANGLE = 1e-6
"""Below this angle [rad] the series is exact to rounding and the closed form is not."""


def mount_pose(mount: Sequence[float]) -> Pose:
    """Return the pose that six numbers give: position x, y, z [m], and roll, pitch, yaw [deg], the
    angles of rotations about the fixed x, y and z axes, made in this order.
    """
    (cr, sr), (cp, sp), (cy, sy) = ((cos(radians(a)), sin(radians(a))) for a in mount[3:])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return Pose(about_z @ about_y @ about_x, np.array(mount[:3]))


def skew(w: Array) -> Array:
    """Return the matrix (3, 3) whose product with a vector p (3,) is the cross product w x p, for w
    (3,).
    """
    x, y, z = w.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exp_so3(w: Array) -> Array:
    """Return the rotation matrix (3, 3) of the rotation vector w (3,) [rad] (Rodrigues)."""
    angle = sqrt(w.dot(w))
    W = skew(w)
    if angle < SMALL_ANGLE:
        return IDENTITY + W + W @ W / 2
    return IDENTITY + np.sin(angle) / angle * W + (1 - np.cos(angle)) / angle**2 * (W @ W)


def log_so3(R: Array) -> Array:
    """Return the rotation vector (3,) [rad] of a rotation matrix (3, 3) whose angle is below pi."""
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    axis = np.array([(h - f) / 2, (c - g) / 2, (d - b) / 2])
    sine = sqrt(axis @ axis)
    cosine = (a + e + i - 1) / 2
    if sine < SMALL_ANGLE and cosine > 0:
        return axis
    return axis * (atan2(sine, cosine) / sine)


def angle_of(R: Array) -> float:
    """Return the rotation angle, 0..pi [rad], of a rotation matrix (3, 3).

    >>> round(angle_of(exp_so3(np.array([0.0, 0.0, 0.5]))), 6)
    0.5
    """
    sine = np.linalg.norm(R - R.T) / np.sqrt(8)
    return float(np.arctan2(sine, (np.trace(R) - 1) / 2))


def left_jacobian(w: Array) -> Array:
    """Return the left Jacobian (3, 3) of SO(3) at a rotation vector w (3,) [rad]: it maps the rate
    of w to the angular velocity in the frame that does not move.
    """
    angle = sqrt(w.dot(w))
    W = skew(w)
    if angle < SMALL_ANGLE:
        return IDENTITY + W / 2 + W @ W / 6
    a = (1 - np.cos(angle)) / angle**2
    b = (angle - np.sin(angle)) / angle**3
    return IDENTITY + a * W + b * (W @ W)


def exp_se3(xi: Array) -> Pose:
    """Return the pose T_before_after of a frame that moves for 1 s with the constant twist xi (6,):
    linear velocity [m/s], then angular velocity [rad/s], both in the moving frame.
    """
    return Pose(exp_so3(xi[3:]), left_jacobian(xi[3:]) @ xi[:3])


def adjoint(T_a_b: Pose) -> Array:
    """Return the matrix (6, 6) that converts the twist (v, w) of a rigid body in frame b to its
    twist in frame a. In either frame v [m/s] is the velocity of the body's point at the frame's
    origin, and w [rad/s] its angular velocity.
    """
    R = T_a_b.rotation
    return np.block([[R, skew(T_a_b.translation) @ R], [np.zeros((3, 3)), R]])


def log_se3(pose: Pose) -> Array:
    """Return the constant twist (6,), linear velocity [m/s], then angular velocity [rad/s], both in
    the moving frame, with which a frame moves by the pose T_before_after in 1 s. It is the inverse
    of `exp_se3`, and needs a rotation of less than pi.
    """
    w = log_so3(pose.rotation)
    t = pose.translation
    half = sqrt(w @ w) / 2
    share = (1 - half / tan(half)) / (4 * half**2) if half > SMALL_ANGLE else 1 / 12
    across = skew(w) @ t
    return np.concatenate([t - across / 2 + share * (skew(w) @ across), w])


def half_turn(angle: float) -> float:
    """Return an angle [rad] shifted by a multiple of pi into (-pi/2, pi/2]: the direction of a
    shape that looks the same after a half turn.
    """
    return np.pi / 2 - (np.pi / 2 - angle) % np.pi


def tilt(rotation: Array) -> float:
    """Return the angle, 0..pi [rad], between a camera's optical axis (its z) and the world's -z
    (straight down), given the rotation R_world_camera (3, 3).
    """
    axis = rotation[:, 2]
    return float(np.arctan2(np.hypot(axis[0], axis[1]), -axis[2]))


def is_rotation(R: Array, tolerance: float) -> bool:
    """Return whether a matrix (3, 3) of finite numbers is a rotation: whether its determinant is
    positive, and no entry of R R^T - I is larger than `tolerance` in magnitude.
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return volume > 0 and bool(np.abs(R @ R.T - IDENTITY).max() <= tolerance)


def is_finite(values: Array) -> bool:
    """Return True if no number of an array is inf or nan."""
    # The sum of squares is one quick call; it is infinite for very large finite numbers, too.
    return isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())


def inverse(A: Array) -> Array:
    """Return the inverse (n, n) of a square matrix; on small matrices three times as fast as
    numpy's.

    Raises:
        LinAlgError: The matrix is singular.
    """
    factors, pivots, singular = lapack.dgetrf(A)
    if singular:
        raise np.linalg.LinAlgError("Singular matrix")
    return lapack.dgetri(factors, pivots)[0]


def inverse_if_strong(A: Array, weakest: float) -> Array | None:
    """Return the inverse (n, n) of a square matrix if it is certain that no singular value of the
    matrix is below `weakest`; else, or if the matrix is singular, return None.

    It is certain if 1 / |A^-1|, with the Frobenius norm, is at least `weakest`, because every
    singular value is at least 1 / |A^-1|. This is faster than a singular value decomposition.
    `weakest` has the unit of the matrix; for a share of the largest singular value, give the share
    times |A|, which is at least that value.
    """
    try:
        plain = inverse(A)
    except np.linalg.LinAlgError:
        return None
    return plain if weakest**2 * float(np.vdot(plain, plain)) <= 1.0 else None
