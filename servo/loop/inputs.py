"""Checks of what a caller gives to a loop, before a part of it sees a wrong value.

A camera or a robot that reports a number without a meaning must not become a motion.
"""

from math import isfinite
from numbers import Integral

import numpy as np

from servo.contracts import LARGEST, outline_fault
from servo.loop.settings import Setup
from sim.geometry import is_rotation
from sim.types import Array, Camera, DepthPicture, Frame, Image, Pose, Posture
from tracking.types import Region, State

ROUNDING = 1e-6
"""A rotation of single precision is a rotation still."""


def check_setup(setup: Setup, camera: Camera, outline: Array) -> None:
    """Check what a loop is built from.

    Raises:
        ValueError: One of them is of another type, or has numbers without a meaning.
    """
    check_type("scenario", setup, Setup)
    check_type("camera", camera, Camera)
    numbers = camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height
    _check_numbers("camera", numbers, (6,))
    if min(camera.fx, camera.fy, camera.width, camera.height) <= 0:
        raise ValueError(f"camera: focal lengths and sides should be above 0, got {camera}")
    for side in (camera.width, camera.height):
        if type(side) is bool or not isinstance(side, Integral):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ValueError(f"camera: sides should be whole numbers of pixels, got {side!r}")
    _check_numbers("outline", outline, (4, 3))
    if fault := outline_fault(outline):
        raise ValueError(f"outline: {fault}")


def check_start(frame: Frame, camera: Camera, region: Region, state: State) -> None:
    """Check what a loop is started with; whether the region is one, the tracker decides.

    Raises:
        ValueError: One of them is of another type, or the picture is not the camera's.
    """
    check_frame(frame, camera)
    check_type("region", region, Region)
    check_type("state", state, State)


def check_frame(frame: Frame, camera: Camera) -> None:
    """Check a picture and its stamp.

    Raises:
        ValueError: It does not fit the camera, or its stamp is not finite.
    """
    check_type("frame", frame, Frame)
    check_picture("frame", frame.image, camera)
    if frame.depth is not None:
        _check_depth(frame.depth, (camera.height, camera.width))
    if not isfinite(frame.time):
        raise ValueError(f"frame: expected a finite time, got {frame.time}")


def check_picture(name: str, image: Image, camera: Camera) -> None:
    """Check that an array is a picture of a camera.

    Raises:
        ValueError: It has another shape or type.
    """
    shape = camera.height, camera.width, 3
    if not isinstance(image, np.ndarray) or image.shape != shape or image.dtype != np.uint8:  # pyright: ignore[reportUnnecessaryIsInstance]
        found = f"{np.shape(image)} of {getattr(image, 'dtype', type(image).__name__)}"
        raise ValueError(f"{name}: expected a picture {shape} of uint8, got {found}")


def _check_depth(depth: DepthPicture, shape: tuple[int, int]) -> None:
    """Check that an array can be a depth picture; whole numbers are millimetres.

    Raises:
        ValueError: It has another shape or type.
    """
    is_real = np.issubdtype(getattr(depth, "dtype", np.object_), np.floating)
    if np.shape(depth) != shape or not is_real:
        found = f"{np.shape(depth)} of {getattr(depth, 'dtype', type(depth).__name__)}"
        raise ValueError(f"frame: expected a depth picture {shape} of floats [m], got {found}")


def check_posture(posture: Posture) -> None:
    """Check what the robot reports. Its Jacobian need not be finite: laws then leave it alone.

    Raises:
        ValueError: A number is not finite, an array has another shape, or a matrix is no rotation.
    """
    check_type("posture", posture, Posture)
    p = posture
    check_type("posture.T_base_camera", p.T_base_camera, Pose)
    R = p.T_base_camera.rotation
    _check_numbers("posture.T_base_camera.rotation", R, (3, 3))
    _check_numbers("posture.T_base_camera.translation", p.T_base_camera.translation, (3,))
    if not is_rotation(R, ROUNDING):
        raise ValueError(f"posture.T_base_camera: expected a rotation, got {R.tolist()}")
    n = np.size(p.joints)
    _check_numbers("posture.joints", p.joints, (n,))
    if np.shape(p.jacobian) != (6, n):
        raise ValueError(f"posture.jacobian: expected shape {(6, n)}, got {np.shape(p.jacobian)}")
    if not (np.shape(p.lower) == np.shape(p.upper) == (n,) and np.all(p.lower <= p.upper)):
        raise ValueError(
            f"posture: expected {n} limits with lower <= upper, got {p.lower} and {p.upper}"
        )
    _check_numbers("posture.twist", p.twist, (6,))
    for name in ("accepted", "asked"):
        twist = getattr(p, name)
        if twist is not None:
            _check_numbers(f"posture.{name}", twist, (6,))


def check_type(name: str, value: object, kind: type) -> None:
    """Refuse an argument of another type.

    Raises:
        ValueError: It is; the sentence begins with its name.
    """
    if not isinstance(value, kind):
        raise ValueError(f"{name}: expected a {kind.__name__}, got a {type(value).__name__}")


def _check_numbers(name: str, values: object, shape: tuple[int, ...]) -> None:
    found = np.asarray(values)
    if found.shape != shape:
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {found.shape}")
    if found.dtype.kind not in "fiu" or not (np.abs(found) <= LARGEST).all():  # nan is not
        raise ValueError(f"{name}: expected finite numbers up to {LARGEST:g}, got {found.tolist()}")
