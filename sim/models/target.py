"""The target: its MuJoCo model, and the reference rectangle that stands for it in measurements and
control.
"""

import itertools
from dataclasses import dataclass

import mujoco
import numpy as np

from sim.models.model_files import compiled
from sim.types import Array

OUTLINE = "outline"
RAYS = 128
"""Rays along each side: a side of 0.2 m is found to 1.6 mm."""
SHOWN = (np.arange(mujoco.mjNGROUP) < 3).astype(np.uint8)
"""Whether MuJoCo draws each group of geoms by default."""
CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)))


@dataclass(frozen=True, slots=True)
class Target:
    """A target object before it is put into the room, as a target's `Config.build` returns it: its
    MuJoCo model, and the level reference rectangle `outline` that stands for it in measurements and
    control.

    Its frame has x along the nose and z up; z = 0 is the table's top. All its geoms move as one,
    without joints, and `rectangle` gives an outline whose corners (4, 3) [m] are in the right
    order. `found` is True if the outline was found from above, and not given.

    >>> spec = mujoco.MjSpec()
    >>> side = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 0.01])
    >>> target = Target(spec, rectangle(np.array([0.0, 0.0, 0.01]), length=0.1, width=0.1))
    >>> target.outline[1].tolist()
    [0.05, 0.05, 0.01]
    """

    spec: mujoco.MjSpec
    """Its model, of which everything moves as one."""
    outline: Array
    """Corners (4, 3) of its reference rectangle in its frame [m]: level, in the order in which an
    image with the nose to the right shows them, from the top left clockwise."""
    found: bool = False
    """True where the rectangle was found from above, as neither model nor settings give it."""


def target_of(spec: mujoco.MjSpec) -> Target:
    """Return the target with the model `spec`. Its reference rectangle is that of the model's site
    `outline`, or, without such a site, the one that `seen_from_above` finds around the visible
    surface.

    Raises:
        ValueError: The site is not aligned with the model's axes, or no part of the target is seen
            from above.
    """
    own = outline_site(spec)
    return Target(spec, seen_from_above(spec) if own is None else own, found=own is None)


def rectangle(centre: Array, length: float, width: float) -> Array:
    """Return the corners (4, 3) [m] of a level rectangle in a target's frame: rear left, front
    left, front right, rear right, where the front is at +x and the left at +y.

    Args:
        centre: Centre of the rectangle (3,) [m].
        length: Side along the target's x [m].
        width: Side along the target's y [m].
    """
    a = length / 2
    b = width / 2
    return centre + np.array([[-a, b, 0], [a, b, 0], [a, -b, 0], [-a, -b, 0]])


def outline_site(spec: mujoco.MjSpec) -> Array | None:
    """Return the corners (4, 3) [m] of the reference rectangle that a site called `outline` in a
    target's model gives, in the model's frame: rear left, front left, front right, rear right,
    where the front is at +x and the left at +y. Return None if the model has no such site.

    Raises:
        ValueError: The site is not aligned with the model's axes.
    """
    if spec.site(OUTLINE) is None:
        return None
    model = compiled(spec.copy())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    site = data.site(OUTLINE)
    if not np.allclose(site.xmat, np.eye(3).ravel(), atol=1e-6):
        raise ValueError(
            f"the site '{OUTLINE}' is rotated in the model: align its axes with the model's"
        )
    length, width, _ = 2 * model.site(OUTLINE).size
    return rectangle(site.xpos.copy(), length, width)


def seen_from_above(spec: mujoco.MjSpec) -> Array:
    """Return the corners (4, 3) [m] of the rectangle along x and y around the surface of a model
    that is visible from straight above, at the mean height of this surface, in the model's frame:
    rear left, front left, front right, rear right.

    Raises:
        ValueError: No part of the model above z = 0, the table's top, is visible from above.
    """
    model = compiled(spec.copy())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bounds = _bounds(model, data)
    hits = _hits(model, data, *bounds)
    if len(hits) == 0:
        raise ValueError(
            "no visible part of the target lies above the table's top, z = 0: move the model up, "
            "or give it visible shapes"
        )
    low = hits.min(axis=0)
    high = hits.max(axis=0)
    length, width = (high - low)[:2] + (bounds[1] - bounds[0])[:2] / RAYS
    return rectangle(np.append(((low + high) / 2)[:2], hits[:, 2].mean()), length, width)


def _bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Return the lowest and the highest corner (3,) of the box around the drawn geoms, in the
    model's frame [m].
    """
    drawn = [
        data.geom_xpos[g] + (box[:3] + CORNERS * box[3:]) @ data.geom_xmat[g].reshape(3, 3).T
        for g, box in enumerate(model.geom_aabb)
        if SHOWN[model.geom_group[g]]
    ]
    points = np.concatenate(drawn or [np.zeros((1, 3))])
    return points.min(axis=0), points.max(axis=0)


def _hits(model: mujoco.MjModel, data: mujoco.MjData, low: Array, high: Array) -> Array:
    """Return the points (n, 3) [m], in the model's frame, where vertical rays from above, one for
    each cell of a grid from corner `low` to corner `high` (3,), meet the model above z = 0; other
    rays have none.
    """
    middles = (np.arange(RAYS) + 0.5) / RAYS
    xs, ys = (low[i] + middles * (high[i] - low[i]) for i in (0, 1))
    down = np.array([0.0, 0.0, -1.0])
    top = high[2] + 1.0
    hit = np.zeros(1, np.int32)
    found: list[tuple[float, float, float]] = []
    for x, y in itertools.product(xs.tolist(), ys.tolist()):
        far = mujoco.mj_ray(model, data, np.array([x, y, top]), down, SHOWN, True, -1, hit)
        if far >= 0 and top - far > 0:
            found.append((x, y, top - far))
    return np.array(found).reshape(-1, 3)
