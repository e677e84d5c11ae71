"""What a run is made from: its random streams, its settings, and the kinds of its parts."""

from dataclasses import dataclass, replace
from math import radians
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from servo.goals.faced import Depth, GoalConfig, Pixels
from servo.mistake import Mistake
from servo.parts import Controller, Estimator, FeaturesConfig
from servo.sight.estimate_to_sight import SightConfig
from sim.camera.camera import CameraConfig
from sim.channels import Channel, Channels, needs_of
from sim.kinds import PartConfig, kind_of
from sim.kinematics.robot import Design
from sim.leader import LeaderConfig
from sim.marker import marker_of
from sim.miscalibration import BelievedConfig
from sim.models.target import Target
from sim.ranges import LONGEST, Degrees, Place, Time
from sim.stage import Disturbance, Motion
from sim.surroundings import ClutterConfig, GroundConfig, LightConfig
from sim.types import Array, Truth
from sim.world import WorldConfig
from tracking.types import SEES_PICTURES, Tracker

MOST_SEED = (1 << 63) - 1
"""The largest integer that TOML has."""
MOST_LATENCY = 100
"""Frames: three seconds at 30 Hz, beyond any loop that is stable."""
LATENCY = 1
"""Frames, where nothing else is given."""
DOES_NOT_REPEAT = (
    'run.tracker_ms = "measured": the tracker\'s time on this machine decided what it saw, so the '
    "same seed does not give the same numbers"
)


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the random stream of one part: the draws of one part never shift another's."""
    return np.random.default_rng([seed, *name.encode()])


@dataclass(frozen=True, slots=True)
class RunConfig:
    """The episode as a whole."""

    duration: Annotated[float, Ge(0.001), Le(LONGEST)] = 10.0
    """Simulated time [s]."""
    seed: Annotated[int, Ge(0), Le(MOST_SEED)] = 0
    """Seed of every random stream."""
    latency: Annotated[int, Ge(0), Le(MOST_LATENCY)] = LATENCY
    """Frame intervals until a command acts: what frame k asks for moves the camera from frame
    k + latency on, or as much later as its estimate is."""
    latency_ms: Annotated[float, Ge(0), Le(10_000)] | None = None
    """The same as a time [ms], which is then rounded up to the next update of the drives; by
    default `latency` counts."""
    tracker_ms: Annotated[float, Ge(0), Le(60_000)] | Literal["measured"] = 0.0
    """Time that the tracker takes for a picture [ms]: its estimate is there that much later, and it
    skips the pictures that arrive meanwhile, all but the newest. "measured": what it takes on this
    machine, so that a run does not repeat."""
    jitter_ms: Annotated[float, Ge(0), Le(60_000)] = 0.0
    """Longest time from a picture to its arrival at the tracker [ms]; each is drawn evenly from 0
    to it, and no picture overtakes another."""
    ego: bool = False
    """Give the tracker the motion of the target's image that the measured camera motion caused: its
    prediction then covers the target's own motion only."""

    def frames_late(self, period: float) -> float:
        """Return how many frame intervals [s] pass from an estimate until its command acts."""
        return self.latency if self.latency_ms is None else 1e-3 * self.latency_ms / period

    @property
    def repeats(self) -> bool:
        """Return whether the same seed gives the same numbers."""
        return self.tracker_ms != "measured"


@dataclass(frozen=True, slots=True)
class StartConfig:
    """How the first picture differs from the goal."""

    x: Pixels = 0.0
    """Target this far to the right of the goal [px]."""
    y: Pixels = 0.0
    """Target this far below the goal [px]."""
    angle_deg: Degrees = 0.0
    """Target turned by this, from right towards down [deg]."""
    scale: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """Target this many times as large as at the goal."""
    tilt_deg: Annotated[float, Ge(0), Le(85)] = 0.0
    """The camera, level so far, then moves around the target's centre by this angle and keeps it at
    its pixel and depth; angle_deg and scale hold before [deg]."""
    tilt_towards_deg: Degrees = 0.0
    """Side of the picture to which it moves, from right towards down [deg]."""
    pose: tuple[Place, Place, Depth, Degrees, Degrees, Degrees] | None = None
    """In place of all these: the target in the camera's frame (x right, y down, z forward), its
    centre [m] and its rotation vector [deg]. With zeros for the rotation it faces the camera, nose
    to the right."""

    def __post_init__(self) -> None:
        if self.pose is not None and replace(self, pose=None) != StartConfig():
            raise ValueError(
                "pose says all of the first picture; leave x, y, angle_deg, scale, tilt_deg and "
                "tilt_towards_deg out"
            )


@dataclass(frozen=True, slots=True)
class RegionConfig:
    """The region given to the tracker in the first frame: the truth, unless changed here."""

    x: Pixels = 0.0
    """Shifted to the right [px]."""
    y: Pixels = 0.0
    """Shifted down [px]."""
    angle_deg: Degrees = 0.0
    """Turned [deg]."""
    width: Annotated[float, Ge(0), Le(100)] = 1.0
    """Factor on its width."""
    height: Annotated[float, Ge(0), Le(100)] = 1.0
    """Factor on its height."""

    def corners(self, truth: Truth) -> Array:
        """Return the target's corners (4, 2) that the tracker is given [px]."""
        own, given = (np.exp(1j * a) for a in (truth.theta, truth.theta + radians(self.angle_deg)))
        away = (truth.corners - truth.centre) @ [1, 1j] / own
        sized = (away.real * self.width + 1j * away.imag * self.height) * given
        return truth.centre + (self.x, self.y) + np.column_stack([sized.real, sized.imag])


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """What counts in the measures."""

    after: Time = 0.0
    """Time from which errors count [s]."""
    above: Annotated[float, Ge(0), Le(10_000)] = 4.0
    """Servo error above which the camera counts as off the target [px]."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Everything a run depends on."""

    name: str
    run: RunConfig
    world: WorldConfig
    camera: CameraConfig
    goal: GoalConfig
    leader: LeaderConfig
    start: StartConfig
    region: RegionConfig
    sight: SightConfig
    believed: BelievedConfig
    measure: MeasureConfig
    ground: GroundConfig
    clutter: ClutterConfig
    light: LightConfig
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
        """Return why the parts of a camera that stands do not go together; else nothing."""
        stands = self.camera.mounted == "world"
        number = self.leader.id
        if number is None:
            moves = stands and kind_of(self.motion) != "still"
            return "motion: the robot holds the target, so nothing else moves it" if moves else ""
        if not stands:
            return 'leader: it leads a target that the robot holds, so camera.mounted = "world"'
        if self.goal != GoalConfig():
            return "goal: it is beside the leader, so leave [goal] out"
        marker = marker_of(self.target)
        if marker is not None and marker.id == number:
            return f"leader.id: {number} is the target's own tag; choose another one"
        return ""

    @property
    def needs(self) -> Channels:
        """The channels that its parts and its leader need."""
        parts = (self.sight, self.features, self.estimator, self.controller)
        needs = needs_of(self.tracker, SEES_PICTURES).union(*map(needs_of, parts))
        return needs if self.leader.id is None else needs | {Channel.PICTURE}

    @property
    def frames(self) -> int:
        """Return the number of frames of a run."""
        return max(1, round(self.run.duration * self.camera.rate))
