"""A run as a Rerun recording.

| entity | what |
|---|---|
| world/table, world/fixed/* | table top with texture, things that never move |
| world/BODY, world/BODY/* | robot/LINK, target, board: pose; their shapes |
| world/eye, world/eye/image | camera: pose and pinhole; JPEG frames |
| world/eye/image/estimate, goal, truth | green, red and white rectangles |
| world/eye/image/particles | the particle cloud |
| plots/error | distance of the true centre from goal and from estimate [px] |
| plots/features | feature errors e = s - s* |
| plots/motion/FEATURE | de/dt of the target: measured, estimated, true |
| plots/twist/linear, angular | camera twist: commanded, measured |
| plots/nis | innovation of the estimator's filter, squared, over its variance |
| plots/joints, plots/range | joint positions; limited joints within their range, -1..1 |
| plots/tilt | optical axis against straight down [deg] |
| plots/distance, plots/ess | Bhattacharyya distance; effective sample size |
| plots/ms | stage times |
| events | occluded, lost, coasting, searching, found again, saturated |

Timelines: `frame` and `sim_time`. Everything goes out in columns once a second: a log call for each
entity and frame would cost as much as half a rendering.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rerun as rr

from servo.loop.episode import Episode
from servo.loop.events import Event, events
from servo.loop.step import Step
from servo.output.recording.archetypes import (
    IMAGE,
    LINE_RADIUS,
    blueprint,
    goal_corners,
    outline_strips,
    solids,
)
from servo.output.recording.file import RecordingFile
from servo.types import DOF
from sim.shapes import shapes_of, table_top
from sim.types import Array

JPEG_QUALITY = 80
GREEN, RED, WHITE, AMBER = (60, 220, 90), (240, 60, 50), (255, 255, 255), (255, 190, 40)
GREY = (130, 130, 140)
XYZ = ((235, 90, 80), (90, 210, 110), (90, 140, 255))
PALETTE = (*XYZ, AMBER, WHITE, GREY, GREEN, RED)
FRUSTUM = 0.15
"""How far from the camera its image plane is drawn [m]."""
STAGES = ("render", "track", "control", "physics")
LEVELS = {Event.LOST: "ERROR"} | dict.fromkeys(
    (Event.OCCLUDED, Event.SATURATED, Event.HOLDING, Event.SEARCHING), "WARN"
)


class RerunLog:
    """Writes one recording."""

    def __init__(self, path: Path, episode: Episode) -> None:
        self._episode, world = episode, episode.world
        self._features = episode.loop.features.names
        self._robot, self._moving = world.robot, world.moving
        self._at_once = max(1, round(episode.scenario.camera.rate))
        self._file = RecordingFile("servobench", path, blueprint(self._features))
        self._rec = self._file.stream
        self._before: Step | None = None
        self._steps: list[Step] = []
        self._jpegs: list[bytes] = []
        self._log_scene()
        self._name_series()

    def add(self, step: Step) -> None:
        """Log a step; once a second all that was logged goes to the disk.

        Raises:
            Refused: The disk takes no more.
        """
        bgr = cv2.cvtColor(step.frame.image, cv2.COLOR_RGB2BGR)
        _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        self._jpegs.append(jpeg.tobytes())
        for event in events(self._before, step):
            self._rec.set_time("frame", sequence=step.frame.index)
            self._rec.set_time("sim_time", duration=step.frame.time)
            text = f"{event.name}: {event.value}"
            self._rec.log("events", rr.TextLog(text, level=LEVELS.get(event, "INFO")))
        self._before = step
        self._steps.append(step)
        if len(self._steps) >= self._at_once:
            self._send()
            self._file.flush()

    def close(self) -> None:
        """Write what is left and the footer.

        Raises:
            Refused: The disk takes no more.
        """
        self._send()
        self._file.close()

    def _log_scene(self) -> None:
        model, camera = self._episode.world.model, self._episode.world.camera
        corners, texture = table_top(model)
        uv = [[0, 1], [1, 1], [1, 0], [0, 0]]
        mesh = rr.Mesh3D(
            vertex_positions=corners, triangle_indices=[[0, 1, 2], [0, 2, 3]], vertex_texcoords=uv,
            vertex_normals=[[0, 0, 1]] * 4, albedo_texture=texture,
        )  # fmt: skip
        self._rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._rec.log("world/table", mesh, static=True)
        for path, archetype in solids(shapes_of(model), ("fixed", *self._moving)):
            self._rec.log(path, archetype, static=True)
        pinhole = rr.Pinhole(
            focal_length=[camera.fx, camera.fy], principal_point=[camera.cx, camera.cy],
            width=camera.width, height=camera.height, camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=FRUSTUM,
        )  # fmt: skip
        self._rec.log("world/eye", pinhole, static=True)
        for name, colour in (("truth", WHITE), ("goal", RED), ("estimate", GREEN)):
            style = rr.LineStrips2D.from_fields(colors=colour, radii=LINE_RADIUS)
            self._rec.log(f"{IMAGE}/{name}", style, static=True)
        dots = rr.Points2D.from_fields(colors=AMBER, radii=1.0)
        self._rec.log(f"{IMAGE}/particles", dots, static=True)

    def _send(self) -> None:
        if not self._steps:
            return
        steps, jpegs = self._steps, self._jpegs
        self._steps, self._jpegs = [], []
        index = [
            rr.TimeColumn("frame", sequence=[s.frame.index for s in steps]),
            rr.TimeColumn("sim_time", duration=[s.frame.time for s in steps]),
        ]
        self._send_pictures(steps, jpegs, index)
        self._send_numbers(steps, index)

    def _send_pictures(
        self, steps: list[Step], jpegs: list[bytes], index: list[rr.TimeColumn]
    ) -> None:
        images = rr.EncodedImage.columns(blob=jpegs, media_type=["image/jpeg"] * len(jpegs))
        self._rec.send_columns(IMAGE, index, images)
        places = {
            "truth": [s.truth.corners for s in steps],
            "goal": [goal_corners(s) for s in steps],
            "estimate": [s.estimate.outline(s.region) for s in steps],
        }
        for name, corners in places.items():
            strips = [strip for c in corners for strip in outline_strips(c)]
            columns = rr.LineStrips2D.columns(strips=strips)
            per_frame = [len(strips) // len(steps)] * len(steps)
            self._rec.send_columns(f"{IMAGE}/{name}", index, columns.partition(per_frame))
        none = np.zeros((0, 5))
        clouds = [none if s.estimate.particles is None else s.estimate.particles for s in steps]
        points = rr.Points2D.columns(positions=np.concatenate(clouds)[:, :2])
        columns = points.partition([len(c) for c in clouds])
        self._rec.send_columns(f"{IMAGE}/particles", index, columns)

    def _send_numbers(self, steps: list[Step], index: list[rr.TimeColumn]) -> None:
        numbers: dict[str, list[Any]] = defaultdict(list)
        for step in steps:
            for path, values in self._series(step).items():
                numbers[path].append(values)
        for path, rows in numbers.items():
            table = np.asarray(rows, float)
            columns = rr.Scalars.columns(scalars=table.ravel())
            self._rec.send_columns(path, index, columns.partition([table.shape[1]] * len(table)))
        poses = np.stack([s.bodies for s in steps])
        cameras = [s.truth.T_world_camera for s in steps]
        self._send_poses(
            "world/eye", index, [c.translation for c in cameras], [c.rotation for c in cameras]
        )
        for i, name in enumerate(self._moving):
            self._send_poses(f"world/{name}", index, poses[:, i, :, 3], poses[:, i, :, :3])

    def _send_poses(self, path: str, index: list[rr.TimeColumn], t: Any, R: Any) -> None:
        columns = rr.Transform3D.columns(
            translation=np.asarray(t), mat3x3=np.asarray(R).reshape(-1, 9)
        )
        self._rec.send_columns(path, index, columns)

    def _series(self, step: Step) -> dict[str, Array | list[float]]:
        command, measured, seconds = step.command, step.twist_measured, step.seconds
        found: dict[str, Array | list[float]] = {
            "plots/error": [step.servo_error, step.tracking_error],
            "plots/features": step.error,
            "plots/twist/linear": np.concatenate([command.twist[:3], measured[:3]]),
            "plots/twist/angular": np.concatenate([command.twist[3:], measured[3:]]),
            "plots/nis": step.prediction.nis,
            "plots/joints": step.joints,
            "plots/tilt": [np.degrees(step.tilt)],
            "plots/range": self._within_range(step.joints),
            "plots/distance": [step.estimate.distance],
            "plots/ess": [step.estimate.ess],
            "plots/ms": [1e3 * getattr(seconds, stage) for stage in STAGES],
        }
        motions = (step.motion_measured, step.prediction.motion, step.target_motion_true)
        for i, name in enumerate(self._features):
            found[f"plots/motion/{name}"] = [m[i] for m in motions]
        return found

    def _within_range(self, joints: Array) -> Array:
        limited = np.isfinite(self._robot.upper)
        low, high = self._robot.lower[limited], self._robot.upper[limited]
        return np.append(2 * (joints[limited] - low) / (high - low) - 1, [-1.0, 1.0])

    def _name_series(self) -> None:
        limited = [
            n for n, u in zip(self._robot.names, self._robot.upper, strict=True) if np.isfinite(u)
        ]
        colours = [PALETTE[i % len(PALETTE)] for i in range(len(self._features))]
        twists = [*XYZ, *(tuple(c // 2 for c in colour) for colour in XYZ)]
        names: dict[str, tuple[list[str], list[Any]]] = {
            "error": (["servo", "tracking"], [RED, GREEN]),
            "features": (list(self._features), colours),
            "twist/linear": (
                [f"{w} {d}" for w in ("commanded", "measured") for d in DOF[:3]],
                twists,
            ),
            "twist/angular": (
                [f"{w} {d}" for w in ("commanded", "measured") for d in DOF[3:]],
                twists,
            ),
            "joints": (list(self._robot.names), [*XYZ, AMBER, WHITE, GREY]),
            "range": ([*limited, "lower limit", "upper limit"], [*XYZ, AMBER, WHITE, RED, RED]),
            "nis": (list(self._features), colours),
            "tilt": (["tilt"], [GREEN]),
            "distance": (["distance"], [GREEN]),
            "ess": (["effective sample size"], [GREEN]),
            "ms": (list(STAGES), [*XYZ, AMBER]),
            **{
                f"motion/{f}": (["measured", "estimated", "true"], [GREY, GREEN, WHITE])
                for f in self._features
            },
        }
        for path, (series, colours) in names.items():
            lines = rr.SeriesLines(names=series, colors=colours[: len(series)])
            self._rec.log(f"plots/{path}", lines, static=True)
