"""The chain of joints from a robot's base to its flange, found in a model of any shape."""

import re
from dataclasses import dataclass
from difflib import get_close_matches

import mujoco
import numpy as np

from sim.models.quaternion import matrix_of
from sim.types import Pose

ALL_WAYS = 6
"""Joints that a camera needs to be moved and turned in all directions."""
GRIPS = re.compile("grip|jaw|finger|thumb|claw|knuckle|pinch|clamp", re.IGNORECASE)
TURNS = re.compile("roll|pitch|yaw|rot|turn|twist|wrist|flex|pan|tilt", re.IGNORECASE)
"""Words in names of joints: of a jaw, and of an arm, as in `gripper_roll`."""
FINGER = re.compile("jaw|finger|thumb|claw|knuckle|mover|mobile|moving", re.IGNORECASE)
"""Words in names of fingers and jaws."""
TOOL = re.compile(
    r"tool|tcp|grasp|pinch|end_?eff|(^|_)(tip|eef?)(_|\d|$)|gripper_(frame|cent)", re.IGNORECASE
)
"""Words in names of the frames and sites of a tool."""
OUTWARD = re.compile("tool|tcp", re.IGNORECASE)
"""Words of the tool's names that are preferred."""


@dataclass(frozen=True, slots=True)
class Chain:
    """The joints between a robot's base and its flange, the body that carries the camera."""

    flange: str
    """Name of the body or site."""
    body: int
    """The body that the flange is, or is part of."""
    pose: Pose
    """T_body_flange."""
    joints: tuple[int, ...]
    """Joints from the base to the flange, by their numbers in the compiled model."""


def name_all(spec: mujoco.MjSpec) -> None:
    """Give each unnamed body and joint of a model a name such as joint_3, for messages and
    files.
    """
    for what, items in (("body", spec.bodies), ("joint", spec.joints)):
        taken = {item.name for item in items}
        free = (name for i in range(2 * len(items)) if (name := f"{what}_{i}") not in taken)
        for item in items:
            item.name = item.name or next(free)


def chain_to(model: mujoco.MjModel, name: str) -> Chain:
    """Return the chain of joints that moves a body or site, by its name. An empty name stands for
    the end of the longest chain: the only site of its last body, or else that body.

    Raises:
        ValueError: No body or site has that name, or its chain is not of hinges and slides only.
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
    """Return the ids of the joints between a model's base and a body (by id), base first."""
    found: list[int] = []
    while body:
        first = model.body_jntadr[body]
        found[:0] = range(first, first + model.body_jntnum[body])
        body = int(model.body_parentid[body])
    return tuple(found)


def flanges(model: mujoco.MjModel) -> list[tuple[str, str, int]]:
    """Return the candidates for the flange, the most joints first: "site" or "body", its name, and
    its number of joints.

    If any have six joints, the others are left out, and so are the parts that a gripper moves. A
    single part beyond the hand stays if no name tells that it is a jaw.
    """
    hand = _hand(model)
    below = _joints_below(model)
    most = len(joints_to(model, hand))
    moved = [c for c in _children(model, hand) if below[c]]
    last = moved if len(moved) == 1 and not _is_named_jaw(model, moved[0], is_last=True) else []
    bodies = [("body", model.body(i).name, i) for i in range(1, model.nbody)]
    sites = [("site", model.site(i).name, int(model.site_bodyid[i])) for i in range(model.nsite)]
    found = [
        (what, name, joints)
        for what, name, body in sites + bodies
        if name
        and (
            (joints := len(joints_to(model, body))) <= most
            or body in last
            or not _carries(model, hand, body)
        )
    ]
    least = min(ALL_WAYS, most) or 1
    return sorted((f for f in found if f[2] >= least), key=lambda f: -f[2])


def _default(model: mujoco.MjModel) -> str:
    """Return the name of the tool's only site, or else of its body."""
    body = _tool(model, _hand(model))
    sites = [
        name for i in np.flatnonzero(model.site_bodyid == body) if (name := model.site(i).name)
    ]
    return sites[0] if len(sites) == 1 else model.body(body).name


def _hand(model: mujoco.MjModel) -> int:
    """Return the last body of the longest chain, or the body that carries fingers or a jaw."""
    below = _joints_below(model)
    body = 0
    while moving := [c for c in _children(model, body) if below[c]]:
        longest = max(moving, key=lambda c: below[c])
        above = len(joints_to(model, body))
        branches = len(moving) > 1 and (above >= ALL_WAYS or above > below[longest])
        if above and (branches or _is_jaw(model, longest, is_last=below[longest] == 1)):
            break
        body = longest
    return body


def _is_jaw(model: mujoco.MjModel, body: int, *, is_last: bool) -> bool:
    """Return whether a body that one joint moves is the finger or jaw of the hand before it.

    Args:
        model: The robot.
        body: The body, the only part of the hand that moves.
        is_last: True if no further joint follows.
    """
    if _is_named_jaw(model, body, is_last=is_last):
        return True
    # A flange or a tool on the body itself says that it is a link of the arm.
    has_tool = any(map(TOOL.search, _frames(model, int(model.body_parentid[body]))))
    is_alone = bool(model.body_jntnum[body]) and not _frames(model, body)
    return is_last and has_tool and is_alone


def _is_named_jaw(model: mujoco.MjModel, body: int, *, is_last: bool) -> bool:
    if model.body_jntnum[body] != 1:
        return False
    joints = joints_to(model, body)
    *arm, joint = [model.joint(j).name for j in joints]
    first = model.body(model.jnt_bodyid[joints[0]]).name
    # Of a robot that is a finger all joints and bodies are named so.
    moves_jaw = _grips(joint) and not any(map(_grips, arm))
    is_finger = FINGER.search(model.body(body).name) and not FINGER.search(first)
    return moves_jaw or bool(is_last and is_finger and not TURNS.search(joint))


def _frames(model: mujoco.MjModel, body: int) -> list[str]:
    """Return the names of the bodies and sites that are fixed to a body."""
    fixed = [c for c in _children(model, body) if not model.body_jntnum[c]]
    sites = np.flatnonzero(model.site_bodyid == body)
    return [*(model.body(c).name for c in fixed), *(model.site(i).name for i in sites)]


def _grips(joint: str) -> bool:
    return bool(GRIPS.search(joint) and not TURNS.search(joint))


def _tool(model: mujoco.MjModel, hand: int) -> int:
    """Return the body of a tool's frame that is fixed to a hand, or the hand itself."""
    below = _joints_below(model)
    body = hand
    while children := _children(model, body):
        tools = [c for c in children if not below[c] and TOOL.search(model.body(c).name)]
        if tools:
            # ROS-Industrial's tool0 looks out of the robot, ee_link across.
            body = next((c for c in tools if OUTWARD.search(model.body(c).name)), tools[0])
        elif len(children) == 1 and not below[children[0]]:
            body = children[0]
        else:
            break
    return body


def _children(model: mujoco.MjModel, body: int) -> list[int]:
    return [c for c in range(1, model.nbody) if model.body_parentid[c] == body]


def _joints_below(model: mujoco.MjModel) -> list[int]:
    """Return for each body the largest number of joints on a chain from it, with its own joints."""
    below = model.body_jntnum.tolist()
    for body in range(model.nbody - 1, 0, -1):
        parent = int(model.body_parentid[body])
        own = int(model.body_jntnum[parent])
        below[parent] = max(below[parent], own + below[body])
    return below


def _carries(model: mujoco.MjModel, hand: int, body: int) -> bool:
    while body > hand:  # a body's number is higher than its parent's
        body = int(model.body_parentid[body])
    return body == hand


def _near(model: mujoco.MjModel, name: str) -> str:
    known = [found for _, found, _ in flanges(model)]
    near = get_close_matches(name, known, n=1)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"there is {', '.join(known)}" if known else "nothing is moved by joints"
