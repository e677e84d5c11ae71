"""A run as a Rerun recording.

| entity | content |
|---|---|
| world/fixed/* | table with its texture, parts that never move |
| world/BODY, world/BODY/* | robot/LINK, target, board: pose; their shapes |
| world/eye, world/eye/image | camera: pose and pinhole; JPEG frames |
| world/eye/image/estimate, goal, truth | green, red and white rectangles |
| world/eye/image/particles | the particle cloud |
| world/path/0, world/eye/image/path/0, ... | paths of camera and target's corners, in pieces |
| world/eye/depth | the depth picture, where there is one |
| plots/error | distances [px]: true and estimated centre from the goal, and from each other |
| plots/features | feature errors e = s - s* |
| plots/motion/FEATURE | de/dt of the target: measured, estimated, true |
| plots/twist/linear, angular | camera twist: commanded, measured |
| plots/nis | innovation of the estimator's filter, squared, over its variance |
| plots/joints, plots/range | joint positions; limited joints within their range, -1..1 |
| plots/tilt | optical axis against straight down [deg] |
| plots/distance, plots/ess | distance in appearance; effective sample size |
| plots/ms | stage times |
| events | events of the run (`servo.loop.events`), such as that the target is lost |

Timelines: `frame` and `sim_time`. Data is sent in columns, pictures ten at a time and the rest once
a second, because log calls for each entity and frame would take half as long as rendering.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import rerun as rr

from servo.loop.episode import Episode
from servo.loop.events import Event, events
from servo.loop.step import Step
from servo.output.recording import solids
from servo.output.recording.destination import Recording
from servo.output.recording.layout import IMAGE, blueprint_of_run
from servo.output.sinks import Timer
from servo.types import DOF
from sim.kinematics.robot import Robot
from sim.models.assembly import with_stands
from sim.types import Array
from tracking.drawing.colours import ESTIMATE, GOAL, PARTICLES, TRUTH
from tracking.drawing.picture_bytes import encoded, encoded_depth

JPEG_QUALITY = 80
"""Quality of the pictures, 0..100: a recording is looked at, not measured on. A picture has about
14 kB."""
MILLIMETRES = 1000.0
"""Units of a depth picture in a metre."""
GREY = (130, 130, 140)
VIOLET = (165, 110, 230)
"""Colour of the truth in plots (RGB): its white on pictures could not be seen on a white plot."""
XYZ = ((235, 90, 80), (90, 210, 110), (90, 140, 255))
PALETTE = (*XYZ, PARTICLES, VIOLET, GREY, ESTIMATE, GOAL)
PATH_RADIUS = 0.004
"""Half the thickness of the camera's path [m]."""
PICTURES = 10
"""Pictures that are sent together. Larger batches let the memory of Rerun's encoder grow for
thousands of pictures: its allocator keeps a segment for each size that it has met.
"""
PIECE = 500
"""Frames after which a path continues in a new entity. A path in one entity would be written as a
whole again and again: file and memory would grow with it.
"""
FRUSTUM = 0.15
"""Distance from the camera at which its image plane is drawn [m]."""
STAGES = ("render", "track", "control", "physics")
LEVELS = {Event.LOST: "ERROR"} | dict.fromkeys(
    (Event.OCCLUDED, Event.SATURATED, Event.LEAVING, Event.HOLDING, Event.SEARCHING), "WARN"
)


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of one plot in a Rerun recording: path of its entity, names and RGB colours of the
    lines, and a function that returns their values, one for each line, for a step of the run.
    """

    path: str
    names: Sequence[str]
    colours: Sequence[tuple[int, ...]]
    values: Callable[[Step], Sequence[float] | Array]


class RerunLog:
    """Sink (receiver of the steps of a run) that writes pictures, outlines, poses, plots and events
    of each step of an episode into a Rerun recording, about once in `every` seconds of the wall
    clock or more often.
    """

    def __init__(self, recording: Recording, episode: Episode, every: float = 1.0) -> None:
        """Begin a recording.

        Args:
            recording: Destination of the data.
            episode: The run whose steps will be added.
            every: Wall-clock time between two flushes [s].
        """
        self._episode = episode
        self._features = episode.loop.features.names
        self._moving = solids.entities(episode.world.moving)
        self._plots = _plots(episode.world.robot, self._features)
        self._timer = Timer(every)
        self._file = recording
        self.abandon = recording.abandon
        self._rec = recording.begin("servobench", blueprint_of_run(self._features))
        self._before: Step | None = None
        self._steps = list[Step]()
        self._encoder = ThreadPoolExecutor(1, "jpeg")  # OpenCV lets the loop go on meanwhile
        self._jpegs = list[Future[bytes]]()
        self._depths = list[bytes]()
        self._piece = 0
        self._places = list[Array]()
        self._corners = list[Array]()
        self._log_scene()
        self._name_series()

    def add(self, step: Step) -> None:
        """Log a step. Its events, such as a lost target, are logged at once; its picture is sent
        together with up to nine others, and its poses and values with those of other steps, about
        once in `every` seconds (see the class).

        Raises:
            Refused: The destination takes no more data, such as a full disk.
        """
        for event in events(self._before, step):
            self._rec.set_time("frame", sequence=step.frame.index)
            self._rec.set_time("sim_time", duration=step.frame.time)
            limits = step.command.limits + step.joint_limits
            names = {Event.SATURATED: limits, Event.LEAVING: step.command.violated}
            which = ", ".join(names.get(event, ()))
            text = f"{event.name}: {event.value}" + f" ({which})" * bool(which)
            self._rec.log("events", rr.TextLog(text, level=LEVELS.get(event, "INFO")))
        self._before = step
        self._steps.append(replace(step, frame=step.frame.black()))  # a second of pictures is large
        self._jpegs.append(self._encoder.submit(encoded, step.frame.image, JPEG_QUALITY))
        if step.frame.depth is not None:
            self._depths.append(encoded_depth(step.frame.depth))
        if len(self._jpegs) == PICTURES:
            self._send_pictures()
        if self._timer.due():
            self._send()
            self._file.flush()

    def close(self) -> None:
        """Send the data of the last steps, and end the recording.

        Raises:
            Refused: The destination takes no more data, such as a full disk.
        """
        self._send()
        self._encoder.shutdown()
        self._file.close()

    def _log_scene(self) -> None:
        camera = self._episode.world.camera
        self._rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        bodies = ["world/fixed", *self._moving]
        shapes = solids.shapes_of(with_stands(self._episode.world.model))
        for path, archetype in solids.solids(shapes, bodies):
            self._rec.log(path, archetype, static=True)
        pinhole = rr.Pinhole(
            focal_length=[camera.fx, camera.fy],
            principal_point=[camera.cx, camera.cy],
            width=camera.width,
            height=camera.height,
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=FRUSTUM,
        )
        self._rec.log("world/eye", pinhole, static=True)
        for name, colour in (("truth", TRUTH), ("goal", GOAL), ("estimate", ESTIMATE)):
            style = rr.LineStrips2D.from_fields(colors=colour, radii=solids.LINE_RADIUS)
            self._rec.log(f"{IMAGE}/{name}", style, static=True)
        dots = rr.Points2D.from_fields(colors=PARTICLES, radii=1.0)
        self._rec.log(f"{IMAGE}/particles", dots, static=True)

    def _send(self) -> None:
        if not self._steps:
            return
        if self._jpegs:
            self._send_pictures()
        steps = self._steps
        self._steps = []
        index = _times(steps)
        self._send_outlines(steps, index)
        self._send_numbers(steps, index)
        self._log_paths(steps)

    def _send_pictures(self) -> None:
        """Send the camera and depth pictures that were not sent yet; they belong to the newest
        steps.
        """
        count = len(self._jpegs)
        index = _times(self._steps[-count:])
        blobs = [jpeg.result() for jpeg in self._jpegs]
        images = rr.EncodedImage.columns(blob=blobs, media_type=["image/jpeg"] * count)
        self._rec.send_columns(IMAGE, index, images)
        self._jpegs = []
        if self._depths:
            columns = rr.EncodedDepthImage.columns(
                blob=self._depths, media_type=["image/png"] * count, meter=[MILLIMETRES] * count
            )
            self._rec.send_columns("world/eye/depth", index, columns)
            self._depths = []

    def _send_outlines(self, steps: list[Step], index: list[rr.TimeColumn]) -> None:
        """Send the outlines and particles of some steps."""
        places = {
            "truth": [s.truth.corners for s in steps],
            "goal": [s.goal.corners for s in steps],
            "estimate": [s.estimate.outline(s.region) for s in steps],
        }
        for name, corners in places.items():
            strips = [strip for c in corners for strip in solids.outline_strips(c)]
            columns = rr.LineStrips2D.columns(strips=strips)
            per_frame = [len(strips) // len(steps)] * len(steps)
            self._rec.send_columns(f"{IMAGE}/{name}", index, columns.partition(per_frame))
        none = np.zeros((0, 5))
        clouds = [none if s.estimate.particles is None else s.estimate.particles for s in steps]
        points = rr.Points2D.columns(positions=np.concatenate(clouds)[:, :2])
        columns = points.partition([len(c) for c in clouds])
        self._rec.send_columns(f"{IMAGE}/particles", index, columns)

    def _send_numbers(self, steps: list[Step], index: list[rr.TimeColumn]) -> None:
        numbers = {p.path: np.array([p.values(s) for s in steps], float) for p in self._plots}
        motions = np.array(
            [(s.motion_measured, s.prediction.motion, s.target_motion_true) for s in steps]
        )
        numbers |= {f"motion/{f}": motions[:, :, i] for i, f in enumerate(self._features)}
        for path, table in numbers.items():
            columns = rr.Scalars.columns(scalars=table.ravel())
            per_frame = [table.shape[1]] * len(table)
            self._rec.send_columns(f"plots/{path}", index, columns.partition(per_frame))
        poses = np.stack([s.bodies for s in steps])
        cameras = [s.truth.T_world_camera for s in steps]
        self._send_poses(
            "world/eye", index, [c.translation for c in cameras], [c.rotation for c in cameras]
        )
        for i, path in enumerate(self._moving):
            self._send_poses(path, index, poses[:, i, :, 3], poses[:, i, :, :3])

    def _log_paths(self, steps: list[Step]) -> None:
        """Extend the paths of the camera and of the target's corners by some steps: log the newest
        piece of each path again, as a line that is shown at all times.
        """
        self._places += [s.truth.T_world_camera.translation for s in steps]
        self._corners += [s.truth.corners for s in steps]
        path = rr.LineStrips3D([self._places], colors=PARTICLES, radii=PATH_RADIUS)
        self._rec.log(f"world/path/{self._piece}", path, static=True)
        corners = np.stack(self._corners, axis=1)
        paths = rr.LineStrips2D(list(corners), colors=PARTICLES, radii=solids.LINE_RADIUS / 2)
        self._rec.log(f"{IMAGE}/path/{self._piece}", paths, static=True)
        if len(self._places) >= PIECE:
            self._piece += 1
            # The next piece begins where this one ends.
            del self._places[:-1]
            del self._corners[:-1]

    def _send_poses(
        self,
        path: str,
        index: list[rr.TimeColumn],
        t: Sequence[Array] | Array,
        R: Sequence[Array] | Array,
    ) -> None:
        turned = np.asarray(R).reshape(-1, 9)
        columns = rr.Transform3D.columns(translation=np.asarray(t), mat3x3=turned)
        self._rec.send_columns(path, index, columns)

    def _name_series(self) -> None:
        series = {p.path: (list(p.names), list(p.colours[: len(p.names)])) for p in self._plots}
        motion = ["measured", "estimated", "true"], [GREY, ESTIMATE, VIOLET]
        series |= {f"motion/{feature}": motion for feature in self._features}
        for path, (names, colours) in series.items():
            lines = rr.SeriesLines(names=names, colors=colours)
            self._rec.log(f"plots/{path}", lines, static=True)


def _times(steps: list[Step]) -> list[rr.TimeColumn]:
    """Return frame number and simulated time of some steps, as Rerun's timelines."""
    return [
        rr.TimeColumn("frame", sequence=[s.frame.index for s in steps]),
        rr.TimeColumn("sim_time", duration=[s.frame.time for s in steps]),
    ]


def _believed_error(step: Step) -> float:
    """Return the distance between the target's estimated centre and its goal [px], which is what
    the loop knows of its error.
    """
    state = step.estimate.state
    return float(np.hypot(*((state.x, state.y) - step.goal.centre)))


def _plots(robot: Robot, features: Sequence[str]) -> list[Lines]:
    """Return all plots of a run with this robot and the features of these names."""
    limited = np.isfinite(robot.upper)
    low = robot.lower[limited]
    high = robot.upper[limited]
    ranges = [n for n, on in zip(robot.names, limited, strict=True) if on]
    colours = [PALETTE[i % len(PALETTE)] for i in range(len(features))]
    dark = [tuple(c // 2 for c in colour) for colour in XYZ]

    def within_range(step: Step) -> Array:
        return np.append(2 * (step.joints[limited] - low) / (high - low) - 1, [-1.0, 1.0])

    def twist(path: str, part: slice) -> Lines:
        return Lines(
            f"twist/{path}",
            [f"{which} {name}" for which in ("commanded", "measured") for name in DOF[part]],
            [*XYZ, *dark],
            lambda s: np.concatenate([s.command.twist[part], s.twist_measured[part]]),
        )

    return [
        Lines(
            "error",
            ("true centre to goal", "estimated centre to goal", "estimated to true centre"),
            (GOAL, GREY, ESTIMATE),
            lambda s: [s.servo_error, _believed_error(s), s.tracking_error],
        ),
        Lines("features", features, colours, lambda s: s.error),
        twist("linear", slice(3)),
        twist("angular", slice(3, 6)),
        Lines("joints", robot.names, (*XYZ, PARTICLES, VIOLET, GREY), lambda s: s.joints),
        Lines(
            "range",
            [*ranges, "lower limit", "upper limit"],
            (*XYZ, PARTICLES, VIOLET, GOAL, GOAL),
            within_range,
        ),
        Lines("nis", features, colours, lambda s: s.prediction.nis),
        Lines("tilt", ("tilt",), (ESTIMATE,), lambda s: [np.degrees(s.tilt)]),
        Lines("distance", ("distance",), (ESTIMATE,), lambda s: [s.estimate.distance]),
        Lines("ess", ("effective sample size",), (ESTIMATE,), lambda s: [s.estimate.ess]),
        Lines(
            "ms", STAGES, (*XYZ, PARTICLES), lambda s: [1e3 * getattr(s.seconds, n) for n in STAGES]
        ),
    ]
