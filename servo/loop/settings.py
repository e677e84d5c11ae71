"""All settings of a run (`Setup`), the settings classes of the sections run, start, region and
measure of a scenario file, and the random generator of each component.
"""

from dataclasses import dataclass, replace
from math import radians
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from servo.goals.faced import Depth, GoalConfig, Pixels
from servo.goals.picture_world import AtGoalConfig
from servo.mistake import Mistake
from servo.parts import Controller, Estimator, FeaturesConfig
from servo.sight.estimate_to_sight import SightConfig
from sim.camera.camera import CameraConfig
from sim.channels import BY_ARGUMENTS, Channel, Channels, channels_fault, needs_of
from sim.kinds import PartConfig, kind_of
from sim.kinematics.robot import Design
from sim.leader import LeaderConfig
from sim.marker import marker_of
from sim.miscalibration import BelievedConfig
from sim.models.target import Target
from sim.ranges import LONGEST, Degrees, Place, Time
from sim.recording.recorded import RecordingSettings
from sim.stage import Disturbance, Motion
from sim.surroundings import ClutterConfig, GroundConfig, LightConfig, WallsConfig
from sim.types import Array, Truth
from sim.world import WorldConfig
from tracking.types import SEES_PICTURES, Tracker

MOST_SEED = (1 << 63) - 1
"""Largest seed: the largest integer of TOML."""
MOST_LATENCY = 100
"""Largest latency [frames]: three seconds at 30 Hz, far beyond any stable loop."""
LATENCY = 1
"""Default latency [frames]."""
DOES_NOT_REPEAT = (
    'run.tracker_ms = "measured": the tracker\'s time on this machine decided what it saw, so the '
    "same seed does not give the same numbers"
)


def stream(seed: int, name: str) -> np.random.Generator:
    """Return a new random generator for one component of a run. Those of different names are
    independent, so that more draws of one component do not change another's; the same seed and name
    give the same numbers.

    Args:
        seed: Seed of the run.
        name: Name of the component, such as "tracker".
    """
    return np.random.default_rng([seed, *name.encode()])


@dataclass(frozen=True, slots=True)
class RunConfig:
    """Settings of a run: its duration, its seed, and the delays of pictures, tracker and commands.

    The duration is in simulated seconds. `latency` counts frame intervals; `latency_ms`, which
    replaces it, and the other delays are in milliseconds. With `ego` the tracker is given the
    motion of the target's image that the camera's motion causes.
    """

    duration: Annotated[float, Ge(0.001), Le(LONGEST)] = 10.0
    """Simulated time [s]."""
    seed: Annotated[int, Ge(0), Le(MOST_SEED)] = 0
    """Seed of every random stream."""
    latency: Annotated[int, Ge(0), Le(MOST_LATENCY)] = LATENCY
    """Delay from a picture to the motion it causes [frame intervals]: the command computed from
    frame k acts from frame k + latency on, and later if the estimate was late."""
    latency_ms: Annotated[float, Ge(0), Le(10_000)] | None = None
    """The delay as a time [ms], in place of `latency`; rounded up to the next update of the
    drives."""
    tracker_ms: Annotated[float, Ge(0), Le(60_000)] | Literal["measured"] = 0.0
    """Time that the tracker takes for a picture [ms]: its estimate is there that much later, and it
    skips the pictures that arrive meanwhile, all but the newest. "measured": what it takes on this
    machine, so that a run does not repeat."""
    jitter_ms: Annotated[float, Ge(0), Le(60_000)] = 0.0
    """Longest time from a picture to its arrival at the tracker [ms]; each is drawn evenly from 0
    to it, and no picture overtakes another."""
    ego: bool = False
    """Tell the tracker how the measured camera motion has moved the target's image, so that its
    motion model needs to cover the target's own motion only."""

    def frames_late(self, period: float) -> float:
        """Return the delay from an estimate to the effect of its command [frame intervals, not
        rounded]: `latency_ms` over the frame interval, if it is set, else `latency`.

        Args:
            period: Frame interval [s].
        """
        return self.latency if self.latency_ms is None else 1e-3 * self.latency_ms / period

    @property
    def repeats(self) -> bool:
        """Whether the same seed gives the same numbers again: False only if `tracker_ms` is
        "measured".
        """
        return self.tracker_ms != "measured"


@dataclass(frozen=True, slots=True)
class StartConfig:
    """Settings of the start: where the target is in the first picture, relative to the goal.

    They are a shift to the right and down [px], a rotation from right towards down [deg], a size
    ratio, and a tilt of the camera with its direction [deg]; or, in place of all these, the
    target's pose in the camera frame (`pose`: centre [m], rotation vector [deg]).
    """

    x: Pixels = 0.0
    """Distance of the target to the right of the goal [px]."""
    y: Pixels = 0.0
    """Distance of the target below the goal [px]."""
    angle_deg: Degrees = 0.0
    """Angle of the target against the goal, positive from right towards down [deg]."""
    scale: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """Size of the target over its size at the goal."""
    tilt_deg: Annotated[float, Ge(0), Le(85)] = 0.0
    """Tilt of the camera [deg]: placed level by the settings above, it is then moved around the
    target's centre by this angle; the centre keeps its pixel and depth."""
    tilt_towards_deg: Degrees = 0.0
    """Direction in the picture in which the tilt moves the camera, from right towards down
    [deg]."""
    pose: tuple[Place, Place, Depth, Degrees, Degrees, Degrees] | None = None
    """In place of all these settings, the target's pose in the camera frame (x right, y down, z
    forward): its centre [m] and its rotation vector [deg]. With a rotation of zero the target faces
    the camera, its nose to the right."""

    def __post_init__(self) -> None:
        if self.pose is not None and replace(self, pose=None) != StartConfig():
            raise ValueError(
                "pose sets the whole start pose: leave out x, y, angle_deg, scale, tilt_deg and "
                "tilt_towards_deg (start={pose=[...]} replaces them all), or pose"
            )


@dataclass(frozen=True, slots=True)
class RegionConfig:
    """Settings of the errors of the rectangle that the tracker is given in the first picture.

    They are a shift to the right and down [px], a rotation from right towards down [deg], and
    factors on width and height. By default the rectangle is the true one.
    """

    x: Pixels = 0.0
    """Shift of the region to the right [px]."""
    y: Pixels = 0.0
    """Shift of the region down [px]."""
    angle_deg: Degrees = 0.0
    """Rotation of the region, from right towards down [deg]."""
    width: Annotated[float, Ge(0), Le(100)] = 1.0
    """Width of the region over the true width."""
    height: Annotated[float, Ge(0), Le(100)] = 1.0
    """Height of the region over the true height."""

    def corners(self, truth: Truth) -> Array:
        """Return the corners (4, 2) [px] of the rectangle that the tracker is given in the first
        picture: the target's true corners, in their order, shifted, rotated and stretched as these
        settings say.

        Args:
            truth: The target's true corners, centre and angle in the first picture.
        """
        # Complex numbers rotate: turn the corners level, stretch them, and turn them as asked.
        own, given = (np.exp(1j * a) for a in (truth.theta, truth.theta + radians(self.angle_deg)))
        away = (truth.corners - truth.centre) @ [1, 1j] / own
        sized = (away.real * self.width + 1j * away.imag * self.height) * given
        return truth.centre + (self.x, self.y) + np.column_stack([sized.real, sized.imag])


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """Settings of a run's measures: when errors begin to count, and which are off the target.

    The camera counts as off the target while the servo error, the distance of the target's centre
    from its goal in the picture, is larger than `above`.
    """

    after: Time = 0.0
    """Time from which errors count [s]."""
    above: Annotated[float, Ge(0), Le(10_000)] = 4.0
    """Servo error above which the camera counts as off the target [px]."""


@dataclass(frozen=True, slots=True)
class Setup:
    """All settings of a run: its name, and one field for each section of a scenario file.

    Raises:
        Mistake: Settings contradict each other, or a component declares data that it is not given.
    """

    name: str
    run: RunConfig
    world: WorldConfig
    camera: CameraConfig
    goal: GoalConfig
    at_goal: AtGoalConfig
    leader: LeaderConfig
    start: StartConfig
    region: RegionConfig
    sight: SightConfig
    believed: BelievedConfig
    measure: MeasureConfig
    ground: GroundConfig
    walls: WallsConfig
    clutter: ClutterConfig
    light: LightConfig
    recording: RecordingSettings
    robot: PartConfig[Design]
    target: PartConfig[Target]
    motion: PartConfig[Motion]
    tracker: PartConfig[Tracker]
    features: FeaturesConfig
    estimator: PartConfig[Estimator]
    controller: PartConfig[Controller]
    disturbances: tuple[PartConfig[Disturbance], ...]

    def __post_init__(self) -> None:
        refusal = self._refusal()
        if refusal:
            raise Mistake(f"{self.name}: {refusal}")

    def _refusal(self) -> str:
        """Return a sentence that says what is wrong with the settings: a component declares
        channels (kinds of data) that it is not given, or settings of a standing camera or of a
        leader (a second tag that the motion moves) contradict others; "" if nothing is wrong.
        """
        for place in BY_ARGUMENTS:
            fault = channels_fault(place, getattr(self, place))
            if fault:
                return f"{place}: {fault}"
        stands = self.camera.mounted == "world"
        number = self.leader.id
        if number is None:
            moves = stands and kind_of(self.motion) != "still"
            held = (
                'motion: the robot holds the target (camera.mounted = "world"), so that no motion '
                "can move the target: leave [motion] out"
            )
            return held if moves else ""
        if not stands:
            return (
                "leader: a leader needs a target that the robot holds, and the robot holds the "
                'camera: set camera.mounted = "world", or leave [leader] out'
            )
        if self.goal != GoalConfig():
            return (
                "goal: the goal is beside the leader, where leader.beside puts it: leave [goal] out"
            )
        marker = marker_of(self.target)
        if marker is not None and marker.id == number:
            return f"leader.id: {number} is the target's own tag: choose another number"
        return ""

    @property
    def needs(self) -> Channels:
        """Kinds of additional data (channels) that the components of the run use, such as pictures
        or true poses.
        """
        parts = (self.sight, self.features, self.estimator, self.controller)
        needs = needs_of(self.tracker, SEES_PICTURES).union(*map(needs_of, parts))
        return needs if self.leader.id is None else needs | {Channel.PICTURE}

    @property
    def frames(self) -> int:
        """Number of frames of the run: duration times frame rate, rounded to the nearest integer,
        at least 1.
        """
        return max(1, round(self.run.duration * self.camera.rate))
