"""Example pictures, robot postures and views of a target, on which components are tested."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from servo.sight.exact import plane_in, sight_of
from servo.types import CameraImage, Sight
from sim.placement import object_frame
from sim.types import Camera, Frame, Image, Pose, Posture
from tracking.types import Region, State

FIRST = State(80.0, 60.0, 0.3, 1.0)
"""State of the target of `film` in the first picture: x, y [px], theta [rad], scale."""
REGION = Region(40.0, 20.0)
"""Width and height of the target of `film` [px]."""
CAMERA = Camera(290.0, 290.0, 160.0, 120.0, 320, 240)
"""The camera of example views: 320 x 240 px, focal length 290 px."""
OUTLINE = np.array([[-0.1, 0.05, 0.0], [0.1, 0.05, 0.0], [0.1, -0.05, 0.0], [-0.1, -0.05, 0.0]])
"""Corners (4, 3) of the reference rectangle in the target's frame [m]."""
DOWN = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0]))
"""T_room_camera of a camera 1 m above the table that looks straight down."""


def film(
    count: int, gone_after: int | None = None, picture: Image | None = None
) -> Iterator[Frame]:
    """Yield frames of 160 x 120 px, 0.1 s apart, with a target that moves by 1 px a frame to the
    right over a textured ground.

    Args:
        count: Number of frames.
        gone_after: Index of the first frame without the target; None: it stays in the picture.
        picture: Appearance of the target (H, W, 3), RGB, shown 40 px wide; None: two colours.
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
    """Return width and height [px] of the target in the frames of `film`, given the target's
    appearance (H, W, 3) or None.
    """
    if picture is None:
        return REGION
    return Region(REGION.width, REGION.width * picture.shape[0] / picture.shape[1])


def _paint(image: Image, shift: int) -> None:
    """Draw the target of two colours into a picture, in place, shifted to the right [px]."""
    box = cv2.boxPoints(((79.5 + shift, 59.5), (40, 20), float(np.degrees(0.3))))
    cv2.fillConvexPoly(image, np.round(box).astype(int), (30, 60, 220))
    cv2.circle(image, (86 + shift, 62), 5, (240, 240, 60), -1)


def _show(picture: Image, image: Image, shift: int) -> None:
    """Draw the target's appearance into an image, in place, shifted to the right [px]."""
    height, width = picture.shape[:2]
    ends = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    corners = region_of(picture).corners(FIRST) + (shift - 0.5, -0.5)
    H = cv2.getPerspectiveTransform(ends.astype(np.float32), corners.astype(np.float32))
    cv2.warpPerspective(picture, H, image.shape[1::-1], image, borderMode=cv2.BORDER_TRANSPARENT)


def posture() -> Posture:
    """Return the posture of a robot without joints, at rest, with its camera at `DOWN`."""
    return Posture(DOWN, np.zeros(6), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((6, 0)))


def seen_from(T_room_camera: Pose, T_room_target: Pose, *, pixels: bool) -> Sight:
    """Return the exact view of a target from a camera (corners, plane and pose of its reference
    rectangle), with a goal: the view from `DOWN` of a target at the room's origin.

    Args:
        T_room_camera: Pose of the camera in the room.
        T_room_target: Pose of the target in the room.
        pixels: Whether the view includes a picture.
    """
    goal = _seen(DOWN, Pose.planar(0.0, 0.0, 0.0), pixels)
    return replace(_seen(T_room_camera, T_room_target, pixels), goal=goal)


def _seen(T_room_camera: Pose, T_room_target: Pose, pixels: bool) -> Sight:
    """Return the exact view of a target from a camera, as `seen_from` does, but without a goal."""
    T_camera_object = T_room_camera.inverse() @ T_room_target @ object_frame(OUTLINE)
    picture = CameraImage(_textured(T_camera_object), CAMERA) if pixels else None
    return replace(sight_of(T_camera_object, OUTLINE), picture=picture)


def _textured(T_camera_object: Pose) -> Image:
    """Return the picture (H, W, 3) of a plane with a pattern of waves, the x-y plane of an object's
    frame, as the camera `CAMERA` sees it.
    """
    v, u = np.indices((CAMERA.height, CAMERA.width)) + 0.5
    rays = np.dstack([CAMERA.normalise(np.dstack([u, v])), np.ones_like(u)])
    points = rays / (rays @ plane_in(T_camera_object).vector)[..., None]
    x, y, _ = np.moveaxis(T_camera_object.inverse().apply(points), -1, 0)
    grey = 128 + 60 * np.sin(30 * x + 9 * y) + 50 * np.cos(25 * y - 8 * x)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)
