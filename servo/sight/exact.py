"""Exact moments, corners and plane of a rectangle as a camera sees it, computed from its pose in
the camera frame.
"""

from servo.sight import shape_moments
from servo.types import Plane, Sight
from sim.placement import object_frame
from sim.types import Array, Pose


def corners_in(T_camera_object: Pose, outline: Array) -> Array:
    """Return the corners (4, 3) of a rectangle in the camera frame [m], in the order of `outline`.

    Args:
        T_camera_object: Pose of the rectangle in the camera frame [m]: origin in its centre, x
            along the target's nose, z along its normal, away from the camera.
        outline: Corners (4, 3) in the target's own frame [m].
    """
    return (T_camera_object @ object_frame(outline).inverse()).apply(outline)


def plane_in(T_camera_object: Pose) -> Plane:
    """Return the plane of a rectangle in the camera frame: 1/Z = A x + B y + C with A, B, C in 1/m,
    and x, y in normalised image coordinates.

    Args:
        T_camera_object: Pose of the rectangle in the camera frame [m]; the rectangle lies in z = 0.
    """
    normal = T_camera_object.rotation[:, 2]
    return Plane(*(normal / (normal @ T_camera_object.translation)).tolist())


def sight_of(T_camera_object: Pose, outline: Array, goal: Sight | None = None) -> Sight:
    """Return the exact view of a rectangle: moments and corners in normalised image coordinates,
    and plane and pose in the camera frame; angle, size and tilt are marked as measured.

    Args:
        T_camera_object: Pose of the rectangle in the camera frame [m]: origin in its centre, x
            along the target's nose, z along its normal, away from the camera.
        outline: The rectangle's corners (4, 3) in the target's frame [m].
        goal: The desired view of the target, which is stored in the result.
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
