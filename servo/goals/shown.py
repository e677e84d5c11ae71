"""Goal together with the picture that the camera takes there, for features and policies
(controllers) that use pixels.
"""

from dataclasses import replace
from typing import final

from servo.parts import GoalSource
from servo.types import CameraImage, Sight
from sim.types import Frame


@final
class Shown:
    """Source of goals that returns the desired views of another source, and adds the picture that
    the camera takes at the goal to them. That goal must not move.
    """

    moved_by = ""

    def __init__(self, goal: GoalSource, picture: CameraImage) -> None:
        """Store a goal source and the picture at its goal.

        Raises:
            ValueError: The goal moves, but there is only one picture.
        """
        if goal.moved_by:
            raise ValueError(
                f"{goal.moved_by}: features made of pixels compare with one picture, taken at the "
                f"first goal, so the goal must not move: leave {goal.moved_by} out"
            )
        self._goal = goal
        self._picture = picture
        self._bare: Sight | None = None
        self._shown: Sight | None = None

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight | None:
        """Return the desired view of the target for a picture, with the picture at the goal. If the
        wrapped source does not know the goal now (it returns None), return the last desired view,
        or None if there was none yet.

        Args:
            frame: The present picture, which is passed on to the wrapped source.
            by_corners: Whether the tracker reports the target's corners; passed on likewise.
        """
        bare = self._goal.sight(frame, by_corners=by_corners)
        if bare is not None and bare is not self._bare:
            self._bare = bare
            self._shown = replace(bare, picture=self._picture)
        return self._shown
