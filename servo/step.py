"""Everything about one frame of a run, as a value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from servo.types import Command
from sim.geometry import tilt
from sim.types import Array, Frame, Posture, Truth
from tracking.types import Estimate, Region, State, Status


@dataclass(frozen=True, slots=True)
class Seconds:
    """Wall-clock time of the stages of one step [s]."""

    render: float
    track: float
    control: float
    physics: float

    @property
    def total(self) -> float:
        """All stages together [s]."""
        return self.render + self.track + self.control + self.physics


@dataclass(frozen=True, slots=True)
class Step:
    """Everything about one frame and what was done with it. Readers only read."""

    frame: Frame
    truth: Truth
    true_state: State
    """The truth as a tracker would say it: scale 1 in the first frame."""
    region: Region
    """The template that the tracker was given."""
    goal: Array
    """Where the target's centre shall be (2,) [px]."""
    goal_theta: float
    """Direction in which the target's nose shall point [rad]."""
    goal_size: float
    """Size the target shall have [px/m]."""
    estimate: Estimate
    command: Command
    target_motion_true: Array
    """True mean de/dt (4,) of the target's own motion over the last frame interval, in the task's
    scaling.
    """
    bodies: Array
    """Poses (n, 3, 4) of the world's moving bodies, [R | t], in the order of `World.moving`."""
    rates: Array
    """Joint velocities (n,) at the time of the frame [m/s or rad/s]."""
    twist_acting: Array
    """Camera twist (6,) that is asked for until the next frame: the command of `latency` frames
    ago.
    """
    posture: Posture
    """What the robot knew of itself at the time of the frame."""
    limited: bool
    """Whether a joint's limit or rate slows the motion until the next frame."""
    seconds: Seconds

    def light(self) -> Step:
        """The same without pixels and particles, for who keeps thousands of them."""
        blank = np.broadcast_to(np.uint8(0), self.frame.image.shape)
        return replace(
            self,
            frame=replace(self.frame, image=blank),
            estimate=replace(self.estimate, particles=None),
        )

    @property
    def joints(self) -> Array:
        """Joint positions (n,) at the time of the frame [m or rad]."""
        return self.posture.joints

    @property
    def margins(self) -> Array:
        """Way from each joint to its nearer limit (n,) [m or rad]; inf where there is none."""
        p = self.posture
        return np.minimum(p.joints - p.lower, p.upper - p.joints)

    @property
    def twist_measured(self) -> Array:
        """Mean camera twist (6,) over the last frame interval."""
        return self.posture.twist

    @property
    def tilt(self) -> float:
        """Angle between the optical axis and straight down [rad]."""
        return tilt(self.truth.T_world_camera.rotation)

    @property
    def seen(self) -> bool:
        """Whether the tracker saw the target in this frame, and there was one."""
        return self.frame.fresh and self.estimate.status is Status.LOCKED

    @property
    def servo_error(self) -> float:
        """Distance of the target's true centre from the goal [px]."""
        return float(np.hypot(*(self.truth.centre - self.goal)))

    @property
    def tracking_error(self) -> float:
        """Distance of the estimated from the true centre [px]."""
        return float(
            np.hypot(
                *(np.array([self.estimate.state.x, self.estimate.state.y]) - self.truth.centre)
            )
        )
