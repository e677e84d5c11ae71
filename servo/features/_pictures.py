"""Pictures of a sight, for features that are made of pixels."""

from servo.types import CameraImage, Sight


def picture_of(sight: Sight) -> CameraImage:
    """Return the picture of a view of the target.

    Raises:
        ValueError: It has no picture.
    """
    if sight.picture is None:
        raise ValueError("there is no picture of the goal: give it to Loop.start as `goal`")
    return sight.picture
