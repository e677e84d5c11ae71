"""A goal that is shown by a picture, for features and policies that are made of pixels."""

from dataclasses import replace
from typing import final

from servo.parts import GoalSource
from servo.types import CameraImage, Sight
from sim.types import Frame


@final
class Shown:
    """Another goal, with the picture that the camera takes there."""

    moved_by = ""

    def __init__(self, goal: GoalSource, picture: CameraImage) -> None:
        """Take the goal and its picture.

        Raises:
            ValueError: The goal moves, and its picture would not.
        """
        if goal.moved_by:
            raise ValueError(
                f"{goal.moved_by}: pixels are compared with one picture, taken at the first goal, "
                "so this goal cannot move"
            )
        self._goal = goal
        self._picture = picture
        self._bare: Sight | None = None
        self._shown: Sight | None = None

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight | None:
        """Return the desired sight, with the goal's picture."""
        bare = self._goal.sight(frame, by_corners=by_corners)
        if bare is not None and bare is not self._bare:
            self._bare = bare
            self._shown = replace(bare, picture=self._picture)
        return self._shown
