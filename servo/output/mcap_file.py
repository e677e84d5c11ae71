"""A run or a track as an MCAP log for Foxglove, by foxglove-sdk.

| topic | messages |
|---|---|
| /camera/image | foxglove.CompressedImage: JPEG, frame `camera` |
| /camera/depth | foxglove.RawImage (run): 32FC1 [m], nan where there is none (ROS REP 118) |
| /camera/calibration | foxglove.CameraCalibration (run): the true camera |
| /camera/annotations | foxglove.ImageAnnotations: estimate, goal, truth; particles |
| /tf | foxglove.FrameTransforms (run): world to base and target, base to camera |
| /step, /shot | JSON: the row of steps.parquet; confidence, status, state, milliseconds |

Times are those of the frames; of a track's pictures their own stamps, where its source has some. A
log whose program was killed lacks its last chunk and its index;
`mcap recover` writes it again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.steps_table import quantities
from sim.models.quaternion import quaternion_of
from sim.types import Array, Camera, DepthPicture, Image, Pose
from tracking.drawing import colours
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track import Shot
from tracking.files.json_text import as_json
from tracking.types import Region

if TYPE_CHECKING:
    from foxglove import messages as fox

NEEDS = "--mcap needs the package foxglove-sdk: install servobench[mcap]"
CHUNK = 1 << 18
"""Size after which a chunk is written [bytes]."""
JPEG_QUALITY = 85
NANO = 1_000_000_000
LATEST = NANO << 32
"""Stamps that Foxglove's messages cannot hold begin here [ns]: their seconds have 32 bits."""
LENSES = {"plumb_bob": "plumb_bob", "rational": "rational_polynomial", "fisheye": "kannala_brandt"}
"""Foxglove's names of the distortions."""
MIDDLE = 0.5
"""Place of the first pixel's middle: zero in ROS and OpenCV [px]."""
Corners = Mapping[tuple[int, int, int], Array]


def check_installed() -> None:
    """Refuse where the optional package is missing.

    Raises:
        Mistake: It is; the sentence names the extra.
    """
    try:
        import foxglove  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise Mistake(NEEDS) from None


class McapFile:
    """An MCAP file; a frame's messages have its time `at` [ns]."""

    def __init__(self, path: Path, numbers: str) -> None:
        """Open a new file; `numbers` is the topic of the rows.

        Raises:
            OSError: The file cannot be written.
        """
        import foxglove
        from foxglove import channels, mcap, messages

        self._fox = messages
        self._context = context = foxglove.Context()  # kept: its channels end with it
        self._file = _CheckedFile(path)
        options = mcap.MCAPWriteOptions(chunk_size=CHUNK, compression_threads=0)
        self._writer = foxglove.open_mcap(self._file, context=context, writer_options=options)  # type: ignore[arg-type]
        self._image = channels.CompressedImageChannel("/camera/image", context=context)
        self._depth = channels.RawImageChannel("/camera/depth", context=context)
        self._calibration = channels.CameraCalibrationChannel(
            "/camera/calibration", context=context
        )
        self._annotations = channels.ImageAnnotationsChannel("/camera/annotations", context=context)
        self._tf = channels.FrameTransformsChannel("/tf", context=context)
        self._rows = foxglove.Channel(numbers, schema={"type": "object"}, context=context)

    def picture(
        self, at: int, image: Image | None, corners: Corners, particles: Array | None
    ) -> None:
        """Write a picture, the outlines in it and the particles."""
        fox = self._fox
        stamp = self._stamp(at)
        if image is not None:
            jpeg = encoded(image, JPEG_QUALITY)
            message = fox.CompressedImage(
                timestamp=stamp, frame_id="camera", data=jpeg, format="jpeg"
            )
            self._image.log(message, log_time=at)
        kinds = fox.PointsAnnotationType
        points = [
            self._points(stamp, kinds.LineLoop, shape, colour)
            for colour, shape in corners.items()
            if np.isfinite(shape).all()
        ]
        if particles is not None:
            points.append(self._points(stamp, kinds.Points, particles[:, :2], colours.PARTICLES))
        self._annotations.log(fox.ImageAnnotations(points=points), log_time=at)

    def depth(self, at: int, depth: DepthPicture) -> None:
        """Write a depth picture."""
        height, width = depth.shape
        message = self._fox.RawImage(
            timestamp=self._stamp(at),
            frame_id="camera",
            width=width,
            height=height,
            encoding="32FC1",
            step=width * depth.itemsize,
            data=depth.tobytes(),
        )
        self._depth.log(message, log_time=at)

    def calibration(self, at: int, camera: Camera) -> None:
        """Write the intrinsics of a camera."""
        lens = camera.distortion
        stamp = self._stamp(at)
        k = [camera.fx, 0, camera.cx - MIDDLE, 0, camera.fy, camera.cy - MIDDLE, 0, 0, 1]
        message = self._fox.CameraCalibration(
            timestamp=stamp,
            frame_id="camera",
            width=camera.width,
            height=camera.height,
            distortion_model="plumb_bob" if lens is None else LENSES[lens.model],
            D=[0.0] * 5 if lens is None else list(lens.coefficients),
            K=k,
            R=np.eye(3).ravel().tolist(),
            P=[*k[:3], 0, *k[3:6], 0, *k[6:], 0],
        )
        self._calibration.log(message, log_time=at)

    def transforms(self, at: int, poses: Mapping[tuple[str, str], Pose]) -> None:
        """Write poses by their frames, parent and child."""
        fox = self._fox
        stamp = self._stamp(at)
        found: list[fox.FrameTransform] = []
        for (parent, child), pose in poses.items():
            (x, y, z) = pose.translation.tolist()
            (w, *axis) = quaternion_of(pose.rotation).tolist()
            found.append(
                fox.FrameTransform(
                    timestamp=stamp,
                    parent_frame_id=parent,
                    child_frame_id=child,
                    translation=fox.Vector3(x=x, y=y, z=z),
                    rotation=fox.Quaternion(x=axis[0], y=axis[1], z=axis[2], w=w),
                )
            )
        self._tf.log(fox.FrameTransforms(transforms=found), log_time=at)

    def row(self, at: int, values: Mapping[str, Any]) -> None:
        """Write numbers and texts by their names, the last of a frame's messages.

        Raises:
            OSError: The file cannot be written.
        """
        self._rows.log(as_json(dict(values)), log_time=at)
        self._file.check()

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: It cannot be written.
        """
        try:
            self._writer.close()
        finally:
            self._file.check()
            self._file.close()

    def abandon(self) -> None:
        """Close the file after an error: what the disk refuses is left out."""
        self._writer.close()  # else it complains on stderr when it is deleted
        self._file.close()

    def _stamp(self, at: int) -> fox.Timestamp:
        return self._fox.Timestamp(sec=at // NANO, nsec=at % NANO)

    def _points(self, stamp: Any, kind: Any, points: Array, colour: tuple[int, int, int]) -> Any:
        r, g, b = (part / 255 for part in colour)
        return self._fox.PointsAnnotation(
            timestamp=stamp,
            type=kind,
            thickness=2.0,
            points=[self._fox.Point2(x=x, y=y) for x, y in points.tolist()],
            outline_color=self._fox.Color(r=r, g=g, b=b, a=1.0),
        )


class _CheckedFile:
    """An unbuffered file that keeps its first error: the writer only prints errors."""

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
    """Writer of the log of one run."""

    def __init__(self, path: Path, episode: Episode) -> None:
        super().__init__(path, "/step")
        robot = episode.world.robot
        self._quantities = quantities(episode.loop.features, robot.names, robot.units)

    def add(self, step: Step) -> None:
        """Write a step.

        Raises:
            OSError: The file cannot be written.
        """
        at = round(step.frame.time * NANO)
        truth = step.truth
        if step.frame.index == 0:
            self.calibration(at, step.scene.camera)
        outlines = {
            colours.TRUTH: truth.corners,
            colours.GOAL: step.goal_corners,
            colours.ESTIMATE: step.estimate.outline(step.region),
        }
        image = step.frame.image if step.frame.fresh else None
        self.picture(at, image, outlines, step.estimate.particles)
        if step.frame.fresh and step.frame.depth is not None:
            self.depth(at, step.frame.depth)
        self.transforms(
            at,
            {
                ("world", "base"): Pose(np.eye(3), np.zeros(3)),
                ("base", "camera"): step.posture.T_base_camera,
                ("world", "target"): truth.T_world_target,
            },
        )
        self.row(at, dict(cell for q in self._quantities for cell in q.cells(step)))


class TrackMcap(McapFile):
    """Writer of the log of one track."""

    def __init__(self, path: Path, region: Region) -> None:
        super().__init__(path, "/shot")
        self._region = region
        self._zero = 0

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a shot.

        Raises:
            OSError: The file cannot be written.
        """
        found = shot.estimate
        picture = shot.picture
        at = round(picture.time * NANO)
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
