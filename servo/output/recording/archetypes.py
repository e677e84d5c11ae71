"""What recordings are made of: their file, solids, rectangles, and the layout of the viewer."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

import ctypes
import shutil
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused
from servo.output.room_view import EYE, LOOKS_AT
from servo.output.shapes import Shape
from sim.models.quaternion import quaternion_of
from sim.types import Array

IMAGE = "world/eye/image"
LINE_RADIUS = 0.6


def solids(shapes: list[Shape], bodies: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Entity paths and archetypes of shapes: one for each body and kind, and for each mesh; given
    the entity paths of the bodies by number.
    """
    groups: dict[tuple[int, str], list[Shape]] = defaultdict(list)
    for number, shape in enumerate(s for s in shapes if s.rgba[3] > 0):
        if shape.surface is not None:
            path = rr.new_entity_path(["mesh", shape.name or f"{number}"])
            yield bodies[shape.body] + path, _mesh(shape)
        else:
            groups[shape.body, shape.kind].append(shape)
    for (body, kind), members in groups.items():
        yield f"{bodies[body]}/{kind}", _archetype(kind, members)


def entities(names: Sequence[str]) -> list[str]:
    """Entity paths of bodies whose poses are logged in the world, so that none lies below another.

    "robot/yaw" may lie below "world/robot", which is no body; "target/door" may not lie below
    "world/target".
    """
    found: list[str] = []
    for number, name in enumerate(names):
        group, _, rest = name.partition("/")
        parts = [group, rest] if rest and group not in names else [name or f"body_{number}"]
        found.append(rr.new_entity_path(["world", *parts]))
    return found


def _mesh(shape: Shape) -> rr.Mesh3D:
    surface = shape.surface
    assert surface is not None
    return rr.Mesh3D(
        vertex_positions=shape.pose.apply(surface.vertices),
        vertex_normals=surface.normals @ shape.pose.rotation.T,
        vertex_texcoords=surface.uv,
        albedo_texture=surface.picture,
        albedo_factor=shape.rgba,
    )


def _archetype(kind: str, members: list[Shape]) -> Any:
    sizes = np.stack([m.size for m in members])
    centres = np.stack([m.pose.translation for m in members])
    turned = [np.roll(quaternion_of(m.pose.rotation), -1) for m in members]
    style: dict[str, Any] = {
        "quaternions": [rr.Quaternion(xyzw=xyzw) for xyzw in turned],
        "colors": [m.rgba for m in members],
        "fill_mode": "solid",
    }
    if kind == "box":
        return rr.Boxes3D(half_sizes=sizes, centers=centres, **style)
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=sizes, centers=centres, **style)
    if kind == "cylinder":
        return rr.Cylinders3D(radii=sizes[:, 0], lengths=2 * sizes[:, 1], centers=centres, **style)
    # The origin of a capsule is its first end in Rerun, and its centre in MuJoCo.
    axes = np.stack([m.pose.rotation[:, 2] for m in members])
    begin = centres - axes * sizes[:, 1:2]
    return rr.Capsules3D(radii=sizes[:, 0], lengths=2 * sizes[:, 1], translations=begin, **style)


def outline_strips(corners: Array) -> list[Array]:
    """A closed rectangle and a tick that shows its front, as two lines."""
    front = (corners[1] + corners[2]) / 2
    nose = np.stack([(corners.mean(axis=0) + front) / 2, front])
    return [np.vstack([corners, corners[:1]]), nose]


def outline(corners: Array, colour: tuple[int, int, int]) -> rr.LineStrips2D:
    """The archetype of a rectangle with corners (4, 2) [px]."""
    return rr.LineStrips2D(outline_strips(corners), colors=colour, radii=LINE_RADIUS)


def blueprint(features: Sequence[str]) -> rrb.Blueprint:
    """Camera and scene to the left, numbers over time to the right, events below."""
    eye = rrb.EyeControls3D(position=EYE, look_target=LOOKS_AT, eye_up=(0, 0, 1))

    def plot(name: str, title: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(origin=f"plots/{name}", name=title)

    pictures = rrb.Vertical(
        rrb.Spatial2DView(origin=IMAGE, name="Camera: estimate green, goal red, truth white"),
        rrb.Spatial3DView(origin="world", name="Robot", eye_controls=eye, line_grid=False),
    )
    motion = [plot(f"motion/{name}", f"Target motion, {name}") for name in features]
    tabs = [rrb.Tabs(*part) for part in (motion[0::2], motion[1::2]) if part]
    numbers = rrb.Vertical(
        plot("error", "Distance of the true centre from goal and estimate [px]"),
        rrb.Tabs(
            plot("features", "Feature errors"),
            plot("range", "Joints within their range"),
            plot("joints", "Joints"),
            plot("tilt", "Tilt of the camera [deg]"),
            plot("nis", "Innovation squared over its variance"),
        ),
        rrb.Horizontal(*tabs),
        rrb.Tabs(
            plot("twist/linear", "Camera velocity [m/s]"),
            plot("twist/angular", "Camera turn [rad/s]"),
        ),
        rrb.Tabs(
            plot("distance", "Distance in appearance"),
            plot("ess", "Effective sample size"),
            plot("ms", "Stages [ms]"),
        ),
        rrb.TextLogView(origin="events", name="Events"),
        row_shares=[3, 3, 3, 3, 2, 2],
    )
    columns = rrb.Horizontal(pictures, numbers, column_shares=[1, 1])
    return rrb.Blueprint(
        columns, rrb.TimePanel(timeline="sim_time", state="collapsed"), collapse_panels=True
    )


PATIENCE = 10.0
"""Longest wait for the disk, which then counts as not writable [s]."""
FULL = 1 << 16
"""A disk with less free space counts as full [bytes]."""


class Recording(Protocol):
    """Where a recording goes: a file, or a viewer."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """The stream to log to."""
        ...

    def flush(self) -> None:
        """Wait until everything that was logged has arrived.

        Raises:
            Refused: It cannot.
        """
        ...

    def close(self) -> None:
        """Send the last data, and end; errors are those of `flush`."""
        ...


def new_stream(app: str, name: str | None) -> rr.RecordingStream:
    """A stream that goes nowhere yet, of a recording with a name, without Rerun's own times."""
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(app, recording_id=name)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def flushed(stream: rr.RecordingStream, refused: Callable[[], Refused]) -> None:
    """Wait until everything that was logged has arrived.

    Raises:
        Refused: It does not; what `refused` gives.
    """
    try:
        stream.flush(timeout_sec=PATIENCE)
    except RuntimeError:
        # Deleting the stream, and Rerun's shutdown, would wait for the last bytes for ever.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
        rr.unregister_shutdown()
        raise refused() from None


class RecordingFile:
    """A file that a recording goes to; it has the name of its folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the file."""
        self._stream = new_stream(app, self.path.parent.name)
        self._stream.save(self.path, default_blueprint=blueprint)
        return self._stream

    def flush(self) -> None:
        """Wait until everything that was logged is in the file.

        Raises:
            Refused: The disk cannot be written; the part written before can be opened.
        """
        flushed(self._stream, self._refused)

    def _refused(self) -> Refused:
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = "the disk is full" if full else "the disk refuses more"
        return Refused(f"{self.path}: the recording ends too early: {why}")

    def close(self) -> None:
        """Write the last data and the footer.

        Raises:
            Refused: As for `flush`; the file then stays as it is.
        """
        self.flush()
        self._stream.disconnect()
