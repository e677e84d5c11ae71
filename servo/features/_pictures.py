"""Pictures of a sight, for features that are made of pixels."""

from servo.types import CameraImage, Sight


def picture_of(sight: Sight) -> CameraImage:
    """Return the picture of a view of the target.

    Raises:
        ValueError: It has no picture.
    """
    if sight.picture is None:
        raise ValueError("a picture is missing: give Loop.start that of the goal as `goal`")
    return sight.picture
