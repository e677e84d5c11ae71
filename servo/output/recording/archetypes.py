"""Archetypes of recordings: solids in the room, and rectangles in the picture."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import rerun as rr

from servo.output.shapes import Shape
from sim.models.quaternion import quaternion_of
from sim.types import Array

LINE_RADIUS = 0.6
"""Half the width of an outline [px]."""


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
