"""What the checks begin with: a part from whatever names it, and things for it to work on."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from servo.sight.exact import object_frame, plane_in, sight_of
from servo.types import CameraImage, Sight
from sim import kinds
from sim.installed import Trusted
from sim.kinds import Kinds
from sim.types import Camera, Frame, Image, Pose, Posture
from tracking.types import Region, State

FIRST = State(80.0, 60.0, 0.3, 1.0)
REGION = Region(40.0, 20.0)
"""Where the target of `film` is in the first picture, and its size."""
CAMERA = Camera(290.0, 290.0, 160.0, 120.0, 320, 240)
OUTLINE = np.array([[-0.1, 0.05, 0.0], [0.1, 0.05, 0.0], [0.1, -0.05, 0.0], [-0.1, -0.05, 0.0]])
"""The reference rectangle (4, 3) of a target [m]."""
DOWN = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0]))
"""T_room_camera: straight down, 1 m above the table."""


class BrokenContract(AssertionError):
    """A part does not do what its kind must do; the sentence says what, and what would be right."""


def require(holds: object, sentence: str) -> None:
    """Raise the sentence where something does not hold.

    Raises:
        BrokenContract: It does not hold.
    """
    if not holds:
        raise BrokenContract(sentence)


def contract(check: Callable[..., None]) -> Callable[..., None]:
    """A check in which an exception of the part itself is a sentence too."""

    @functools.wraps(check)
    def checked(*part: Any, **more: Any) -> None:
        try:
            check(*part, **more)
        except BrokenContract:
            raise
        except Exception as error:
            raise BrokenContract(f"it raised {type(error).__name__}: {error}") from error

    return checked


def config_of(folder: Kinds[Any], part: Any) -> Any:
    """The `Config` instance of what a check was given.

    Raises:
        BrokenContract: It is no part of this kind.
    """
    given = part
    if dataclasses.is_dataclass(given) and not isinstance(given, type):
        return given
    try:
        if isinstance(part, str):
            return folder.config_of(Trusted(part))()
        return folder.as_config(part, getattr(part, "__qualname__", repr(part)))()
    except kinds.UnknownKind as error:
        raise BrokenContract(str(error)) from error


def built(config: Any, methods: tuple[str, ...], seed: int = 0) -> Any:
    """What a `Config` builds, which must have these methods.

    Raises:
        BrokenContract: A method is missing.
    """
    found = config.build(np.random.default_rng(seed))
    for name in methods:
        require(
            callable(getattr(found, name, None)),
            f"build(rng) gave {type(found).__name__}, which has no method {name}",
        )
    return found


def film(
    count: int, gone_after: int | None = None, picture: Image | None = None
) -> Iterator[Frame]:
    """A target that drifts over a textured ground, gone later if asked: of two colours, or what a
    picture (H, W, 3) shows, 40 px wide.
    """
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.integers(60, 140, (120, 160, 3)).astype(np.uint8), (0, 0), 2)
    for k in range(count):
        image = ground.astype(np.uint8)
        if gone_after is None or k < gone_after:
            if picture is None:
                _paint(image, k)
            else:
                _show(picture, image, k)
        image.setflags(write=False)
        yield Frame(image, k * 0.1, k)


def region_of(picture: Image | None) -> Region:
    """The region of the target in `film`."""
    if picture is None:
        return REGION
    return Region(REGION.width, REGION.width * picture.shape[0] / picture.shape[1])


def _paint(image: Image, shift: int) -> None:
    box = cv2.boxPoints(((79.5 + shift, 59.5), (40, 20), float(np.degrees(0.3))))
    cv2.fillConvexPoly(image, np.round(box).astype(int), (30, 60, 220))
    cv2.circle(image, (86 + shift, 62), 5, (240, 240, 60), -1)


def _show(picture: Image, image: Image, shift: int) -> None:
    height, width = picture.shape[:2]
    ends = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    corners = region_of(picture).corners(FIRST) + (shift - 0.5, -0.5)
    H = cv2.getPerspectiveTransform(ends.astype(np.float32), corners.astype(np.float32))
    cv2.warpPerspective(picture, H, image.shape[1::-1], image, borderMode=cv2.BORDER_TRANSPARENT)


def posture() -> Posture:
    """A robot without joints that stands still, its camera `DOWN`."""
    return Posture(DOWN, np.zeros(6), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((6, 0)))


def seen_from(T_room_camera: Pose, T_room_target: Pose, *, pixels: bool) -> Sight:
    """All that is seen of the reference rectangle, exactly; `DOWN` over the room's origin it is the
    goal.

    Args:
        T_room_camera: Pose of the camera.
        T_room_target: Pose of the rectangle.
        pixels: Whether a picture of it is needed too.
    """
    goal = _seen(DOWN, Pose.planar(0.0, 0.0, 0.0), pixels)
    return replace(_seen(T_room_camera, T_room_target, pixels), goal=goal)


def _seen(T_room_camera: Pose, T_room_target: Pose, pixels: bool) -> Sight:
    T_camera_object = T_room_camera.inverse() @ T_room_target @ object_frame(OUTLINE)
    picture = CameraImage(_textured(T_camera_object), CAMERA) if pixels else None
    return replace(sight_of(T_camera_object, OUTLINE), picture=picture)


def _textured(T_camera_object: Pose) -> Image:
    """A picture of waves on the rectangle's plane."""
    v, u = np.indices((CAMERA.height, CAMERA.width)) + 0.5
    rays = np.dstack([CAMERA.normalise(np.dstack([u, v])), np.ones_like(u)])
    points = rays / (rays @ plane_in(T_camera_object).vector)[..., None]
    x, y, _ = np.moveaxis(T_camera_object.inverse().apply(points), -1, 0)
    grey = 128 + 60 * np.sin(30 * x + 9 * y) + 50 * np.cos(25 * y - 8 * x)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)
