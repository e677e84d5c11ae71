"""Checks of the arguments of a loop, so that an invalid number from a camera or robot never causes
a motion.
"""

from math import isfinite
from numbers import Integral, Real

import numpy as np

from servo.contracts import LARGEST, outline_fault
from servo.loop.settings import Setup
from sim.geometry import is_rotation
from sim.types import Array, Camera, DepthPicture, Frame, Image, Pose, Posture
from tracking.types import Region, State

ROUNDING = 1e-6
"""Tolerated rounding error of a rotation matrix: that of single precision."""


def check_setup(setup: Setup, camera: Camera, outline: Array) -> None:
    """Check the types and numbers of the arguments of `Loop`: a scenario, the camera's intrinsics,
    and an outline, which is the corners (4, 3) [m] of a rectangle at one height, clockwise as seen
    from above.

    Raises:
        ValueError: An argument has the wrong type or shape, or invalid numbers.
    """
    check_type("scenario", setup, Setup)
    check_type("camera", camera, Camera)
    numbers = camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height
    _check_numbers("camera", numbers, (6,))
    if min(camera.fx, camera.fy, camera.width, camera.height) <= 0:
        raise ValueError(f"camera: focal lengths and sides should be above 0, got {camera}")
    sides = camera.width, camera.height
    if any(type(s) is bool or not isinstance(s, Integral) for s in sides):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ValueError(f"camera: sides should be whole numbers of pixels, got {sides}")
    _check_numbers("outline", outline, (4, 3))
    if fault := outline_fault(outline):
        raise ValueError(f"outline: {fault}")


def check_start(frame: Frame, camera: Camera, region: Region, state: State) -> None:
    """Check the arguments with which a loop is started: the types of frame, region and state, the
    sizes of picture and depth picture, and that the frame's time is finite. The numbers of region
    and state are not checked here, but by the tracker.

    Args:
        frame: The first picture.
        camera: The camera whose size the picture should have.
        region: The target's rectangle in that picture.
        state: The target's state in that picture.

    Raises:
        ValueError: An argument has the wrong type, size or time.
    """
    check_frame(frame, camera)
    check_type("region", region, Region)
    check_type("state", state, State)


def check_frame(frame: Frame, camera: Camera) -> None:
    """Check that a frame's picture is (height, width, 3) of uint8 with the camera's height and
    width, its depth picture, if there is one, (height, width) of floats, and its time finite.

    Raises:
        ValueError: The argument is no `Frame`, a picture has another shape or type, or the time is
            not finite.
    """
    check_type("frame", frame, Frame)
    check_picture("frame", frame.image, camera)
    if frame.depth is not None:
        _check_depth(frame.depth, (camera.height, camera.width))
    if not isinstance(frame.time, Real) or not isfinite(frame.time):
        raise ValueError(f"frame.time: expected a finite number [s], got {frame.time!r}")


def check_picture(name: str, image: Image, camera: Camera) -> None:
    """Check that an array is a picture of a camera: (height, width, 3) of uint8.

    Args:
        name: Name of the argument, with which the error's message begins.
        image: The array.
        camera: Camera whose height and width the picture should have.

    Raises:
        ValueError: The array has another shape or type.
    """
    shape = camera.height, camera.width, 3
    if np.shape(image) != shape or getattr(image, "dtype", None) != np.uint8:
        found = f"{np.shape(image)} of {_type_of(image)}"
        raise ValueError(f"{name}: expected a picture {shape} of uint8, got {found}")


def _check_depth(depth: DepthPicture, shape: tuple[int, int]) -> None:
    """Check that an array is a depth picture: floats [m] of a shape (H, W). Integers are refused,
    because they would be millimetres.

    Raises:
        ValueError: The array has another shape or type.
    """
    if np.shape(depth) != shape or not _type_of(depth).startswith("float"):
        found = f"{np.shape(depth)} of {_type_of(depth)}"
        raise ValueError(f"frame: expected a depth picture {shape} of floats [m], got {found}")


def _type_of(values: object) -> str:
    """Return the name of an array's element type, such as "uint8"; for any other object, the name
    of its class.
    """
    return values.dtype.name if isinstance(values, np.ndarray) else type(values).__name__


def check_posture(posture: Posture) -> None:
    """Check the types, shapes and numbers of the posture that a robot reports. Infinite joint
    limits are allowed, and so are infinite or nan elements of the Jacobian. The limits of joint
    rates and the commands `under_way` are not checked.

    Raises:
        ValueError: An object has the wrong type, an array the wrong shape, another number is not
            finite or its absolute value above 1e9, a lower joint limit is above the upper one, or
            the rotation is no rotation matrix.
    """
    check_type("posture", posture, Posture)
    p = posture
    check_type("posture.T_base_camera", p.T_base_camera, Pose)
    R = p.T_base_camera.rotation
    _check_numbers("posture.T_base_camera.rotation", R, (3, 3))
    _check_numbers("posture.T_base_camera.translation", p.T_base_camera.translation, (3,))
    if not is_rotation(R, ROUNDING):
        raise ValueError(
            "posture.T_base_camera.rotation: expected a rotation matrix (orthogonal, determinant "
            f"1), got {R.tolist()}"
        )
    n = np.asarray(p.joints).size
    _check_numbers("posture.joints", p.joints, (n,))
    J = np.asarray(p.jacobian)
    if J.shape != (6, n):
        raise ValueError(f"posture.jacobian: expected shape {(6, n)}, got {J.shape}")
    lower = np.asarray(p.lower)
    upper = np.asarray(p.upper)
    if not (lower.shape == upper.shape == (n,) and (lower <= upper).all()):
        raise ValueError(
            f"posture.lower, posture.upper: expected {n} limits each, with lower <= upper, got "
            f"{p.lower} and {p.upper}"
        )
    _check_numbers("posture.twist", p.twist, (6,))
    twists = {"accepted": p.accepted, "asked": p.asked}
    for name, twist in twists.items():
        if twist is not None:
            _check_numbers(f"posture.{name}", twist, (6,))


def check_type(name: str, value: object, kind: type) -> None:
    """Check that an argument is an object of a class or its subclasses.

    Args:
        name: Name of the argument, with which the error's message begins.
        value: The argument.
        kind: The class.

    Raises:
        ValueError: The object is of another class.
    """
    if not isinstance(value, kind):
        raise ValueError(f"{name}: expected a {kind.__name__}, got a {type(value).__name__}")


def _check_numbers(name: str, values: object, shape: tuple[int, ...]) -> None:
    found = np.asarray(values)
    if found.shape != shape:
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {found.shape}")
    # The sum of squares is one quick call, and seldom large: then each number is looked at.
    if found.dtype.kind == "f" and np.vdot(found, found) <= LARGEST:
        return
    if found.dtype.kind not in "fiu" or not (np.abs(found) <= LARGEST).all():  # nan is not
        raise ValueError(
            f"{name}: expected finite numbers from {-LARGEST:g} to {LARGEST:g}, got "
            f"{found.tolist()}"
        )
