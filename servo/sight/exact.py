"""The exact sight of a rectangle from its pose."""

from servo.sight import shape_moments
from servo.types import Plane, Sight
from sim.placement import object_frame
from sim.types import Array, Pose


def corners_in(T_camera_object: Pose, outline: Array) -> Array:
    """Return the corners (4, 3) of a rectangle in the camera frame [m].

    Args:
        T_camera_object: Pose of the frame that `Sight.pose` describes.
        outline: Corners (4, 3) in the target's frame [m].
    """
    return (T_camera_object @ object_frame(outline).inverse()).apply(outline)


def plane_in(T_camera_object: Pose) -> Plane:
    """Return the plane of a rectangle in the camera frame, 1/Z = A x + B y + C with A, B, C in 1/m.
    The rectangle is in the plane z = 0 of the object's frame, whose pose is given [m].
    """
    normal = T_camera_object.rotation[:, 2]
    return Plane(*(normal / (normal @ T_camera_object.translation)).tolist())


def sight_of(T_camera_object: Pose, outline: Array, goal: Sight | None = None) -> Sight:
    """Return the exact sight of a rectangle in a pose.

    Args:
        T_camera_object: The pose, of the frame that `Sight.pose` describes.
        outline: The rectangle's corners (4, 3) in the target's frame [m].
        goal: The desired sight.
    """
    points = corners_in(T_camera_object, outline)
    corners = points[:, :2] / points[:, 2:]
    return Sight(
        shape_moments.of_polygon(corners),
        plane_in(T_camera_object),
        tilt_known=True,
        corners=corners,
        measured_pose=T_camera_object,
        goal=goal,
    )
