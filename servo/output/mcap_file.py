"""Runs and tracks as MCAP logs for Foxglove and the tools of ROS 2, by foxglove-sdk and rosbags.

| topic | messages |
|---|---|
| /camera/image/compressed | sensor_msgs/CompressedImage: JPEG, frame `camera` |
| /camera/depth | sensor_msgs/Image (run): 32FC1 [m], nan where there is none (ROS REP 118) |
| /camera/camera_info | sensor_msgs/CameraInfo (run): the true camera, for each picture |
| /camera/annotations | foxglove_msgs/ImageAnnotations: estimate, goal, truth; particles |
| /estimate | geometry_msgs/PolygonStamped: corners of the estimate in the picture [px], z = 0 |
| /tf | tf2_msgs/TFMessage (run): world to base and target, base to camera |
| /step, /shot | run: the row of steps.parquet; track: frame, status, state, confidence, time |

All are messages of ROS 2 in CDR, with their definitions (`ros2msg`): /step and /shot have types of
our own, in `servobench_msgs`, with a field for each number.

Times of messages are those of the frames; in a track they are the stamps of its pictures, where its
source has stamps. A log of a killed program lacks its last chunk and its index: `mcap recover`
repairs it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from servo.closing import closing
from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output import ros2_messages as ros2
from servo.output.ros2_messages import Kind
from servo.output.steps_table import quantities_of, row_of
from servo.scenario.calibration import camera_info
from sim.models.quaternion import quaternion_of
from sim.types import Array, Camera, DepthPicture, Image, Pose
from tracking.drawing import colours
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track import Shot
from tracking.types import Region, State

NEEDS = "--mcap needs the packages foxglove-sdk and rosbags: install servobench[mcap]"
CHUNK = 1 << 18
"""Size after which a chunk is written [bytes]."""
JPEG_QUALITY = 85
"""Higher than in a Rerun recording: trackers may be run on the log's pictures."""
LATEST = ros2.SECOND << 31
"""The first stamp that a message cannot hold [ns], as its seconds are a signed integer of 32
bits."""
FRAME = "camera"
TOPICS = {
    "/camera/image/compressed": "sensor_msgs/CompressedImage",
    "/camera/depth": "sensor_msgs/Image",
    "/camera/camera_info": "sensor_msgs/CameraInfo",
    "/camera/annotations": "foxglove_msgs/ImageAnnotations",
    "/estimate": "geometry_msgs/PolygonStamped",
    "/tf": "tf2_msgs/TFMessage",
}
"""The type of the messages of each topic; the rows of numbers have a type of their own."""
POINTS, LINE_LOOP = 1, 2
"""Numbers of Foxglove's kinds of annotations."""
SHOT = {
    "frame": "int64",
    "status": "string",
    **dict.fromkeys((f.name for f in fields(State)), "float64"),
    "confidence": "float64",
    "milliseconds": "float64",
}
"""Fields of a track's rows."""
NOT_A_FIELD = re.compile("[^A-Za-z0-9]+")
"""Characters that become "_" in the name of a message's field, such as those of a joint's name."""
Corners = Mapping[tuple[int, int, int], Array]


def check_installed() -> None:
    """Check that the packages for MCAP logs, foxglove-sdk and rosbags, are installed.

    Raises:
        Mistake: A package is missing; the sentence names the extra.
    """
    try:
        import foxglove  # noqa: F401  # pyright: ignore[reportUnusedImport]
        import rosbags.typesys  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise Mistake(NEEDS) from None


class McapFile:
    """Writer of an MCAP log (a file for Foxglove and ROS 2) with several messages for each frame:
    picture, depth picture, calibration, outlines, poses, and a row of numbers. The row has the
    topic `topic`, such as "/step"; `columns` has the ROS type of each of its columns, such as
    "float64". In all methods, `at` is the frame's time [ns].
    """

    def __init__(self, path: Path, topic: str, columns: Mapping[str, str]) -> None:
        """Open a new file.

        Args:
            path: File to write; an older one is replaced.
            topic: Topic of the rows, such as "/step".
            columns: ROS types of the rows' columns by name, such as "float64".

        Raises:
            OSError: The file cannot be written.
        """
        import foxglove
        from foxglove import mcap

        self._context = context = foxglove.Context()  # kept: its topics end with it
        self._file = _CheckedFile(path)
        options = mcap.MCAPWriteOptions(profile="ros2", chunk_size=CHUNK, compression_threads=0)
        self._writer = foxglove.open_mcap(self._file, context=context, writer_options=options)  # type: ignore[arg-type]
        self._topic = topic
        self._fields = _fields(columns)
        fields = {self._fields[name]: of for name, of in columns.items()}
        own = Kind(f"servobench_msgs/{topic.strip('/').capitalize()}", fields)
        self._kinds = {name: Kind(kind) for name, kind in TOPICS.items()} | {topic: own}
        self._channels = {
            name: foxglove.Channel(
                name,
                schema=foxglove.Schema(name=kind.name, encoding="ros2msg", data=kind.definition),
                message_encoding="cdr",
                context=context,
            )
            for name, kind in self._kinds.items()
        }

    def _log(self, topic: str, at: int, /, **fields: object) -> None:
        """Write a message with these fields to a topic.

        Args:
            topic: The topic.
            at: Time of the message [ns]: since the beginning of the run, or by the clock of its
                source.
            **fields: Values by the names of the message's fields.
        """
        self._channels[topic].log(self._kinds[topic].encoded(**fields), log_time=at)

    def picture(
        self, at: int, image: Image | None, corners: Corners, particles: Array | None
    ) -> None:
        """Write the messages of a frame's picture: the picture as JPEG, annotations (outlines and
        particles to be drawn over it), and the corners of the estimate.

        Args:
            at: Time of the frame [ns].
            image: RGB (H, W, 3); None: there is no picture, and only the other messages are
                written.
            corners: Corners (4, 2) [px] of outlines, by their RGB colour; the last one is the
                estimate. Annotations leave out outlines with a corner that is not finite.
            particles: Particles (n, 2 or more), x and y first [px]; None: the tracker has none.
        """
        header = ros2.header(at, FRAME)
        if image is not None:
            self._log(
                "/camera/image/compressed",
                at,
                header=header,
                format="jpeg",
                data=np.frombuffer(encoded(image, JPEG_QUALITY), np.uint8),
            )
        points = [
            _annotation(at, LINE_LOOP, shape, colour)
            for colour, shape in corners.items()
            if np.isfinite(shape).all()
        ]
        if particles is not None:
            points.append(_annotation(at, POINTS, particles[:, :2], colours.PARTICLES))
        self._log("/camera/annotations", at, circles=[], points=points, texts=[])
        *_, estimate = corners.values()
        self._log(
            "/estimate",
            at,
            header=header,
            polygon=ros2.part(
                "geometry_msgs/Polygon",
                points=[ros2.part("geometry_msgs/Point32", x=x, y=y, z=0.0) for x, y in estimate],
            ),
        )

    def depth(self, at: int, depth: DepthPicture) -> None:
        """Write a message with a depth picture (H, W) [m], nan where there is no depth, as 32-bit
        floats.

        Args:
            at: Time of the frame [ns].
            depth: The depth picture.
        """
        height, width = depth.shape
        self._log(
            "/camera/depth",
            at,
            header=ros2.header(at, FRAME),
            height=height,
            width=width,
            encoding="32FC1",
            is_bigendian=0,
            step=width * depth.itemsize,
            data=np.frombuffer(depth.tobytes(), np.uint8),
        )

    def calibration(self, at: int, camera: Camera) -> None:
        """Write a message with a camera's intrinsics and distortion (CameraInfo).

        Args:
            at: Time [ns] of the picture that the camera took.
            camera: The camera.
        """
        region = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
        known = camera_info(camera)
        numbers = {name: np.array(known[name]) for name in ("d", "k", "r", "p")}
        self._log(
            "/camera/camera_info",
            at,
            header=ros2.header(at, FRAME),
            **known | numbers,
            roi=ros2.part("sensor_msgs/RegionOfInterest", **region, do_rectify=False),
        )

    def transforms(self, at: int, poses: Mapping[tuple[str, str], Pose]) -> None:
        """Write one message with the poses of coordinate frames in their parent frames.

        Args:
            at: Time of the poses [ns].
            poses: Pose T_parent_child, whose translation is in m, by the names (parent, child).
        """
        found = [
            ros2.part(
                "geometry_msgs/TransformStamped",
                header=ros2.header(at, parent),
                child_frame_id=child,
                transform=_transform(pose),
            )
            for (parent, child), pose in poses.items()
        ]
        self._log("/tf", at, transforms=found)

    def row(self, at: int, values: Mapping[str, object]) -> None:
        """Write the message with a frame's numbers and texts; call it after the frame's other
        messages, because it reports their errors too.

        Args:
            at: Time of the frame [ns].
            values: Value of each column; None is written as nan.

        Raises:
            OSError: This message or an earlier one cannot be written.
        """
        self._log(
            self._topic,
            at,
            **{self._fields[name]: np.nan if v is None else v for name, v in values.items()},
        )
        self._file.check()

    def close(self) -> None:
        """Write the remaining messages and the index, and close the file.

        Raises:
            OSError: The file cannot be written.
        """
        with closing(self._file.close):
            self._writer.close()
            self._file.check()

    def abandon(self) -> None:
        """Close the file after an error, with as much of the remaining data as the disk takes;
        errors of writing are ignored.
        """
        self._writer.close()  # else it complains on stderr when it is deleted
        self._file.close()


def _fields(columns: Iterable[str]) -> dict[str, str]:
    """Return the name of a message's field for each column of the rows, by column: "_" replaces
    other characters than letters and digits, and a name that an earlier column has already gets the
    column's number.
    """
    found: dict[str, str] = {}
    for number, column in enumerate(columns):
        name = NOT_A_FIELD.sub("_", column).lower()
        found[column] = f"{name}_{number}" if name in found.values() else name
    return found


def _annotation(at: int, kind: int, points: Array, colour: tuple[int, int, int]) -> object:
    r, g, b = (part / 255 for part in colour)
    return ros2.part(
        "foxglove_msgs/PointsAnnotation",
        timestamp=ros2.stamp(at),
        type=kind,
        points=[ros2.part(ros2.CORNER, x=x, y=y) for x, y in points.tolist()],
        outline_color=ros2.part(ros2.COLOUR, r=r, g=g, b=b, a=1.0),
        outline_colors=[],
        fill_color=ros2.part(ros2.COLOUR, r=0.0, g=0.0, b=0.0, a=0.0),
        thickness=2.0,
    )


def _transform(pose: Pose) -> object:
    (x, y, z) = pose.translation.tolist()
    (w, *axis) = quaternion_of(pose.rotation).tolist()
    return ros2.part(
        "geometry_msgs/Transform",
        translation=ros2.part("geometry_msgs/Vector3", x=x, y=y, z=z),
        rotation=ros2.part("geometry_msgs/Quaternion", x=axis[0], y=axis[1], z=axis[2], w=w),
    )


class _CheckedFile:
    """An unbuffered file that keeps its first error, because foxglove only prints errors."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb", buffering=0)
        self._error: OSError | None = None
        self.seek = self._file.seek
        self.flush = self._file.flush
        self.close = self._file.close

    def write(self, content: bytes) -> int:
        try:
            return self._file.write(content)
        except OSError as error:
            self._error = self._error or error
            return len(content)

    def check(self) -> None:
        if self._error is not None:
            raise self._error


class RunMcap(McapFile):
    """Sink (receiver of the steps of a run) that writes each step of an episode into a new MCAP log
    at `path`.
    """

    def __init__(self, path: Path, episode: Episode) -> None:
        self._quantities = quantities_of(episode)
        columns = [column for q in self._quantities for column in q.columns]
        super().__init__(
            path, "/step", {c.name: str(c.type).replace("double", "float64") for c in columns}
        )

    def add(self, step: Step) -> None:
        """Write the messages of a step: outlines of truth, goal and estimate; the tracker's
        particles, if there are any; poses of robot base, camera and target; and all values of the
        step's row in steps.parquet. If the camera delivered a picture in this frame, write the
        picture, the camera's calibration, and the depth picture (if there is one), too.

        Raises:
            OSError: The file cannot be written.
        """
        at = round(step.frame.time * ros2.SECOND)
        truth = step.truth
        outlines = {
            colours.TRUTH: truth.corners,
            colours.GOAL: step.goal.corners,
            colours.ESTIMATE: step.estimate.outline(step.region),
        }
        image = step.frame.image if step.frame.fresh else None
        self.picture(at, image, outlines, step.estimate.particles)
        if image is not None:
            self.calibration(at, step.scene.camera)
        if step.frame.fresh and step.frame.depth is not None:
            self.depth(at, step.frame.depth)
        self.transforms(
            at,
            {
                ("world", "base"): Pose(np.eye(3), np.zeros(3)),
                ("base", "camera"): truth.T_world_camera,
                ("world", "target"): truth.T_world_target,
            },
        )
        self.row(at, row_of(step, self._quantities))


class TrackMcap(McapFile):
    """Sink (receiver of the pictures of a track) that writes each picture, with the tracker's
    estimate, into a new MCAP log at `path`. `region` is the target's region in the first picture,
    which gives the size of estimated outlines.
    """

    def __init__(self, path: Path, region: Region) -> None:
        super().__init__(path, "/shot", SHOT)
        self._region = region
        self._zero = 0

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write the messages of a tracked picture: the picture, if it could be decoded, the
        outlines of estimate and truth, the particles, and a row of numbers.

        Their time is the stamp of the picture. If the picture has none (or one that ROS 2 cannot
        hold), it is the picture's time since the first picture, plus the difference between stamp
        and this time in the last picture with a stamp (0 before the first stamp).

        Args:
            shot: The picture with its estimate.
            truth: True corners (4, 2) of the target [px]; None: unknown.

        Raises:
            OSError: The file cannot be written.
        """
        found = shot.estimate
        picture = shot.picture
        at = round(picture.time * ros2.SECOND)
        if picture.stamp is not None and 0 <= picture.stamp < LATEST:
            self._zero = picture.stamp - at
        at += self._zero
        outlines: dict[tuple[int, int, int], Array] = (
            {} if truth is None else {colours.TRUTH: truth}
        )
        outlines[colours.STATUS[found.status]] = found.outline(self._region)
        self.picture(at, picture.image, outlines, found.particles)
        numbers = {"confidence": shot.confidence, "milliseconds": 1e3 * shot.seconds}
        state = asdict(found.state)
        self.row(at, {"frame": shot.index, "status": found.status.name} | state | numbers)
