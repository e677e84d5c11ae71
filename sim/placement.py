"""Projection of the target into the picture, camera poses that give a desired projection, and
checks of camera poses (above the table, in front of the target).
"""

from math import atan2, cos, sin, sqrt

import numpy as np

from sim.geometry import exp_so3
from sim.outline import area
from sim.types import Array, Camera, Pose, Truth

MARKS = np.array([*np.eye(4), [0.5, 0.0, 0.5, 0.0], [0.0, 0.5, 0.5, 0.0]])
"""Matrix (6, 4) whose product with the corners (4, 3) of a reference rectangle gives six points (6,
3): the corners, the centre, and the middle of the front side, where the nose is."""
DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation of a level camera that looks straight down with image u along world x."""


def truth(
    camera: Camera,
    outline: Array,
    T_world_camera: Pose,
    T_world_target: Pose,
    visible: float | None = None,
) -> Truth:
    """Return the truth of a target: its exact pose, and the projection of its reference rectangle
    into the image.

    Where a lens distorts, centre and corners are still projected points, theta is the direction
    from the centre to the middle of the nose, and the size is that of the quadrangle of the
    corners.

    Args:
        camera: Intrinsics.
        outline: Corners (4, 3) of the rectangle in the target's frame [m], level, in the order in
            which an image with the nose to the right shows them: top left, top right, bottom right,
            bottom left.
        T_world_camera: Pose of the camera.
        T_world_target: Pose of the target.
        visible: Fraction of the target's silhouette in the picture that other bodies do not hide;
            None: unknown.
    """
    T_camera_target = T_world_camera.inverse() @ T_world_target
    seen = camera.project(T_camera_target.apply(MARKS @ outline))
    corners = seen[:4]
    centre = seen[4]
    nose = seen[5]
    ahead, aside = (nose - centre).tolist()
    return Truth(
        centre=centre,
        theta=atan2(aside, ahead),
        size=sqrt(area(corners) / area(outline)),
        corners=corners,
        T_world_camera=T_world_camera,
        T_world_target=T_world_target,
        visible=visible,
    )


def camera_above(
    camera: Camera, point: Array, heading: float, pixel: Array, theta: float, depth: float
) -> Pose:
    """Return T_world_camera of the camera that looks straight down and sees a world point at a
    given pixel and depth, rotated so that a given direction in the world has a given direction in
    the image.

    Args:
        camera: Intrinsics.
        point: World point (3,) [m].
        heading: Direction in the world, from x towards y [rad].
        pixel: Desired projection of the point (2,) [px].
        theta: Desired direction of the heading in the image, from +u towards +v [rad].
        depth: Distance of the point from the camera along the optical axis [m].
    """
    yaw = heading + _straightened(camera, pixel, theta)
    R = Pose.planar(0.0, 0.0, yaw).rotation @ DOWN
    ray = np.append(camera.normalise(pixel), 1.0) * depth
    return Pose(R, point - R @ ray)


def tilted(T_world_camera: Pose, point: Array, tilt: float, towards: float) -> Pose:
    """Return T_world_camera of a camera that looked straight down and was then moved on an arc
    around a world point, turning with the arc, so that the point stays at the same pixel and depth.

    Args:
        T_world_camera: Pose of the camera before, looking straight down.
        point: World point (3,) [m].
        tilt: Angle of the arc [rad], which is then the angle between the optical axis and straight
            down.
        towards: Direction in the picture to which the camera moves, from +u towards +v [rad].
    """
    R = T_world_camera.rotation
    turn = R @ exp_so3(tilt * np.array([sin(towards), -cos(towards), 0.0])) @ R.T
    return Pose(turn @ R, point + turn @ (T_world_camera.translation - point))


def camera_facing(outline: Array, T_world_target: Pose, T_camera_object: Pose) -> Pose:
    """Return T_world_camera of the camera in whose frame a target's reference rectangle has a
    desired pose.

    Args:
        outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
        T_world_target: Pose of the target.
        T_camera_object: Desired pose of the rectangle's own frame: its origin in the centre, x
            along the nose, z away from a viewer of its front.
    """
    return T_world_target @ object_frame(outline) @ T_camera_object.inverse()


def object_frame(outline: Array) -> Pose:
    """Return T_target_object, the pose of a reference rectangle's own frame in the target's frame:
    its origin is the rectangle's centre, x points along the nose, and z down, away from a viewer of
    its front. `outline` has the corners (4, 3) in the target's frame [m].
    """
    return Pose(DOWN, outline.mean(axis=0))


def object_pose(seen: Truth, outline: Array) -> Pose:
    """Return T_camera_object, the pose of a target's reference rectangle in the camera frame. The
    rectangle's own frame has its origin in the centre, x along the nose and z away from a viewer.

    Args:
        seen: True poses of the camera and of the target.
        outline: Corners (4, 3) of the rectangle in the target's frame [m].
    """
    return seen.T_world_camera.inverse() @ seen.T_world_target @ object_frame(outline)


def check_above_table(T_world_camera: Pose) -> None:
    """Check that a camera, given its pose, is above the table's top, z = 0 in the world.

    Raises:
        ValueError: The camera is not above the table's top, z = 0.
    """
    height = float(T_world_camera.translation[2])
    if height <= 0:
        raise ValueError(
            f"the camera would be {-height:.2f} m below the table's top: place it higher"
        )


def check_sight(outline: Array, T_world_camera: Pose, T_world_target: Pose) -> None:
    """Check that a camera sees the front of a target's reference rectangle, given its corners (4,
    3) in the target's frame [m] and the poses of camera and target.

    Raises:
        ValueError: Part of the rectangle is behind the camera, or the camera is behind its front.
    """
    T_camera_target = T_world_camera.inverse() @ T_world_target
    if T_camera_target.apply(outline)[:, 2].min() <= 0:
        raise ValueError(
            "part of the target would be behind the camera: place the camera farther away, or tilt "
            "it less"
        )
    if T_camera_target.inverse().translation[2] <= outline[0, 2]:
        raise ValueError(
            "the camera would be on the back of the target: place it on the front side"
        )


def truth_above(
    camera: Camera,
    outline: Array,
    pixel: Array,
    theta: float,
    depth: float,
    tilt: float = 0.0,
    towards: float = 0.0,
) -> Truth:
    """Return the truth (exact pose and projection) of a target at the world's origin, with its nose
    along world x, seen by a camera that looks straight down, or is then tilted.

    Args:
        camera: Intrinsics.
        outline: Corners (4, 3) of the target's reference rectangle in its frame [m].
        pixel: Projection of the rectangle's centre (2,) [px].
        theta: Direction of the target's nose in the image, from +u towards +v [rad].
        depth: Distance of the centre along the optical axis [m].
        tilt: Angle by which the camera is then moved around the rectangle's centre [rad].
        towards: Direction in the picture to which it is moved, from +u towards +v [rad].
    """
    middle = outline.mean(axis=0)
    eye = camera_above(camera, middle, 0.0, pixel, theta, depth)
    if tilt:
        eye = tilted(eye, middle, tilt, towards)
    return truth(camera, outline, eye, Pose.planar(0.0, 0.0, 0.0))


def _straightened(camera: Camera, pixel: Array, theta: float) -> float:
    """Return the direction [rad], from x towards y in undistorted normalised image coordinates, of
    a line through a pixel (2,) [px] that has the direction `theta` [rad] in the picture, from +u
    towards +v.
    """
    if camera.is_plain:
        return theta
    step = np.array([cos(theta), sin(theta)]) / 2
    x, y = (camera.normalise(pixel + step) - camera.normalise(pixel - step)).tolist()
    return atan2(y, x)
