"""The chain of joints from a robot's base to its flange, found in a model of any shape."""

from dataclasses import dataclass
from difflib import get_close_matches

import mujoco
import numpy as np

from sim.models.quaternion import matrix_of
from sim.types import Pose

ALL_WAYS = 6
"""Joints that a camera needs to be moved and turned in all directions."""


@dataclass(frozen=True, slots=True)
class Chain:
    """The joints that move a flange."""

    flange: str
    """Name of the body or site."""
    body: int
    """The body that the flange is, or is part of."""
    pose: Pose
    """T_body_flange."""
    joints: tuple[int, ...]
    """Joints from the base to the flange, by their numbers in the compiled model."""


def name_all(spec: mujoco.MjSpec) -> None:
    """Give bodies and joints without a name one, such as joint_3: messages and files need it."""
    for what, items in (("body", spec.bodies), ("joint", spec.joints)):
        taken = {item.name for item in items}
        free = (name for i in range(2 * len(items)) if (name := f"{what}_{i}") not in taken)
        for item in items:
            item.name = item.name or next(free)


def chain_to(model: mujoco.MjModel, name: str) -> Chain:
    """The chain to a body or site; where the name is empty, to the end of the longest chain: the
    only site of its last body, or that body.

    Raises:
        ValueError: There is nothing of that name, or its chain is not of hinges and slides only.
    """
    if model.njnt == 0:
        raise ValueError("the model has no joints")
    name = name or _default(model)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if body < 0 and site < 0:
        raise ValueError(f"there is no body or site '{name}' for the flange; {_near(model, name)}")
    pose = Pose(np.eye(3), np.zeros(3))
    if body < 0:
        body = int(model.site_bodyid[site])
        pose = Pose(matrix_of(model.site_quat[site]), model.site_pos[site].copy())
    joints = joints_to(model, body)
    for joint in joints:
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
            raise ValueError(
                f"the joint '{model.joint(joint).name}' is a ball joint; between base and flange "
                "there may be hinges and slides only"
            )
    if not joints:
        raise ValueError(f"no joint moves the flange '{name}'")
    return Chain(name, body, pose, joints)


def joints_to(model: mujoco.MjModel, body: int) -> tuple[int, ...]:
    """The joints that move a body, from the base on."""
    found: list[int] = []
    while body:
        first = model.body_jntadr[body]
        found[:0] = range(first, first + model.body_jntnum[body])
        body = int(model.body_parentid[body])
    return tuple(found)


def flanges(model: mujoco.MjModel) -> list[tuple[str, str, int]]:
    """Return candidates for the flange: kind, name and number of joints, the most joints first;
    with six joints or more if there are any.
    """
    bodies = [("body", model.body(i).name, i) for i in range(1, model.nbody)]
    sites = [("site", model.site(i).name, int(model.site_bodyid[i])) for i in range(model.nsite)]
    found = [(what, name, len(joints_to(model, b))) for what, name, b in sites + bodies if name]
    least = min(ALL_WAYS, max((joints for _, _, joints in found), default=1)) or 1
    return sorted((f for f in found if f[2] >= least), key=lambda f: -f[2])


def _default(model: mujoco.MjModel) -> str:
    """The name of the last body's only site, or of the last body."""
    body = _end(model)
    sites = [
        name for i in np.flatnonzero(model.site_bodyid == body) if (name := model.site(i).name)
    ]
    return sites[0] if len(sites) == 1 else model.body(body).name


def _end(model: mujoco.MjModel) -> int:
    """The last body of the longest chain, or the one where it branches into fingers."""
    parents = model.body_parentid.tolist()
    children = {
        i: [c for c in range(1, model.nbody) if parents[c] == i] for i in range(model.nbody)
    }
    below = model.body_jntnum.tolist()  # the most joints from each body on
    for i in range(model.nbody - 1, 0, -1):
        below[i] = model.body_jntnum[i] + max((below[c] for c in children[i]), default=0)
    body = 0
    while children[body]:
        moving = [c for c in children[body] if below[c]]
        if not moving and len(children[body]) == 1 and body:
            body = children[body][0]  # a link fixed to the last one, such as a tool's frame
        elif not moving or (len(moving) > 1 and len(joints_to(model, body)) >= ALL_WAYS):
            break
        else:
            body = max(moving, key=lambda c: below[c])
    return body


def _near(model: mujoco.MjModel, name: str) -> str:
    known = [found for _, found, _ in flanges(model)]
    near = get_close_matches(name, known, n=1)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"there is {', '.join(known)}" if known else "nothing is moved by joints"
