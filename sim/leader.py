"""The leader: a moving AprilTag in the room. The scenario's `[motion]` moves it; the robot holds
the target in front of a camera that stands in the room, and is to keep it beside this tag.
"""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from sim.camera.camera import Pose6
from sim.geometry import mount_pose
from sim.marker import Marker
from sim.models.tag_model import tag_target
from sim.models.target import Target
from sim.placement import object_frame
from sim.ranges import Length
from sim.types import Array, Pose

UPRIGHT = (0.0, 0.0, 0.4, 80.0, 0.0, 0.0)
BESIDE = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Default poses, chosen by hand: of the tag in the frame that the motion moves, so that it faces a
camera at `sim.camera.camera.STANDS`; and of the held target beside the tag, 0.2 m to the right as
this camera sees it."""


@dataclass(frozen=True, slots=True)
class LeaderConfig:
    """Settings of the leader, a moving tag, and the desired pose of the held target relative to it.

    The tag is an AprilTag 36h11 with the number `id` (None: no leader) and a black square of the
    side `size` [m]. `on` is its pose in the frame that the scenario's motion moves, `beside` the
    desired pose of the target that the robot holds, relative to the tag: x along the tag's nose,
    which is the right side of its pattern, y down and z away from a viewer who sees the pattern
    upright. Poses are x, y, z [m] and roll, pitch, yaw [deg].
    """

    id: Annotated[int, Ge(0), Le(586)] | None = None
    """Number of its tag in the family AprilTag 36h11; by default there is no leader."""
    size: Length = 0.12
    """Side of the tag's black square [m]."""
    on: Pose6 = UPRIGHT
    """Pose of the tag in the frame that `[motion]` moves: x, y, z [m], roll, pitch, yaw [deg] about
    fixed axes; with zeros it lies on the table, its nose ahead.
    """
    beside: Pose6 = BESIDE
    """Desired pose of the held target relative to the tag: x to the right (along the tag's nose), y
    down, z away from a viewer who sees the tag's pattern upright [m], roll, pitch, yaw [deg] about
    these axes; with zeros for the angles the target is turned as the tag is.
    """

    def leads(self, outline: Array) -> "Leader | None":
        """Return the leader (moving tag) that these settings describe, with the desired pose of the
        target that the robot holds; None if the settings give no tag. `outline` has the corners (4,
        3) [m] of the target's reference rectangle in the target's frame.
        """
        if self.id is None:
            return None
        target = tag_target(Marker(self.id, self.size))
        on = mount_pose(self.on)
        goal = on @ object_frame(target.outline) @ mount_pose(self.beside)
        return Leader(target, on, goal @ object_frame(outline).inverse())


@dataclass(frozen=True, slots=True)
class Leader:
    """A moving AprilTag (`tag`) beside which the robot is to keep the target that it holds: the
    tag's pose and the desired pose of the target, both in the frame that the scenario's motion
    moves.
    """

    tag: Target
    T_moved_leader: Pose
    """Pose of the tag in the frame that the motion moves."""
    T_moved_goal: Pose
    """Desired pose of the held target in the frame that the motion moves."""
