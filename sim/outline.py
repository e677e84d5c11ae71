"""The reference rectangle of a model that names none: what is seen of it from above."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np

from sim.target import rectangle
from sim.types import Array

RAYS = 128
"""Rays along each side: a side of 0.2 m is found to 1.6 mm."""
SHOWN = np.array([1, 1, 1, 0, 0, 0], np.uint8)
"""Groups of geoms that MuJoCo draws unless it is asked for others."""
CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)))


def seen_from_above(spec: mujoco.MjSpec) -> Array:
    """The level rectangle (4, 3) around what is seen of a model from above, at its mean height [m].

    Raises:
        ValueError: Nothing of it is seen above the table, z = 0.
    """
    model = spec.copy().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bounds = _bounds(model, data)
    hits = np.zeros((0, 3)) if bounds is None else _hits(model, data, *bounds)
    if len(hits) == 0:
        raise ValueError("nothing of it is seen from above the table, whose top is at z = 0")
    low, high = hits.min(axis=0), hits.max(axis=0)
    assert bounds is not None
    length, width = (high - low)[:2] + (bounds[1] - bounds[0])[:2] / RAYS
    return rectangle(np.append(((low + high) / 2)[:2], hits[:, 2].mean()), length, width)


def _bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array] | None:
    """The box around the geoms that are drawn: its lowest and highest corner (3,) [m]."""
    drawn = [
        data.geom_xpos[g] + (box[:3] + CORNERS * box[3:]) @ data.geom_xmat[g].reshape(3, 3).T
        for g, box in enumerate(model.geom_aabb)
        if SHOWN[model.geom_group[g]]
    ]
    points = np.concatenate(drawn) if drawn else np.zeros((1, 3))
    return (points.min(axis=0), points.max(axis=0)) if drawn else None


def _hits(model: mujoco.MjModel, data: mujoco.MjData, low: Array, high: Array) -> Array:
    """Where rays straight down, in the middles of a grid's cells, first meet the model (n, 3)."""
    middles = (np.arange(RAYS) + 0.5) / RAYS
    xs, ys = (low[i] + middles * (high[i] - low[i]) for i in (0, 1))
    down, top, hit = np.array([0.0, 0.0, -1.0]), high[2] + 1.0, np.zeros(1, np.int32)
    found: list[tuple[float, float, float]] = []
    for x, y in itertools.product(xs.tolist(), ys.tolist()):
        far = mujoco.mj_ray(model, data, np.array([x, y, top]), down, SHOWN, True, -1, hit)
        if far >= 0 and top - far > 0:
            found.append((x, y, top - far))
    return np.array(found).reshape(-1, 3)
