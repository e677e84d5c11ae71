"""The chain of joints from a robot's base to its flange (the body or site that carries the camera),
found in a model of any shape.
"""

import itertools
import re
from dataclasses import dataclass
from difflib import get_close_matches

import mujoco
import numpy as np

from sim.models.quaternion import matrix_of
from sim.types import Pose

ALL_WAYS = 6
"""Joints that a camera needs to be moved and turned in all directions."""
HINGES = 5
"""A slide at the end of a chain with at least so many hinges moves a jaw: no arm is built so."""
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
    """The joints between a robot's base and its flange, which is the body or site that carries the
    camera: the ids of these joints in the compiled model, the base's first; the id of the body that
    the flange is, or on which it lies; and the pose T_body_flange.
    """

    flange: str
    """Name of the body or site."""
    body: int
    """The body that the flange is, or is part of, by its id in the compiled model."""
    pose: Pose
    """T_body_flange."""
    joints: tuple[int, ...]
    """Joints from the base to the flange, by their ids in the compiled model."""


def name_all(spec: mujoco.MjSpec) -> None:
    """Give each unnamed body and joint of a model a name such as body_2 or joint_3, in place, so
    that messages can name it.
    """
    for what, items in (("body", spec.bodies), ("joint", spec.joints)):
        taken = {item.name for item in items}
        free = (name for i in range(2 * len(items)) if (name := f"{what}_{i}") not in taken)
        for item in items:
            item.name = item.name or next(free)


def chain_to(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str) -> Chain:
    """Return the chain of joints between a robot's base and a body or site.

    Args:
        spec: A model in which all bodies and joints have names.
        model: The same model, compiled.
        name: Name of the body or site. An empty text stands for the tool at the end of the longest
            chain: its only site, or else its body.

    Raises:
        ValueError: The model has no joints, no body or site has that name, no joint moves it, or a
            ball joint does.
    """
    if not spec.joints:
        raise ValueError("the model has no joints: a robot needs at least one hinge or slide")
    name = name or _default(spec)
    site = spec.site(name)
    body = spec.body(name) or (site and site.parent)
    if body is None:
        raise ValueError(f"there is no body or site '{name}' for the flange; {_near(spec, name)}")
    pose = Pose(np.eye(3), np.zeros(3))
    if spec.body(name) is None:
        placed = model.site(name)
        pose = Pose(matrix_of(placed.quat), placed.pos.copy())
    joints = _joints(body)
    for joint in joints:
        if joint.type == mujoco.mjtJoint.mjJNT_BALL:
            raise ValueError(
                f"the joint '{joint.name}' between base and flange is a ball joint: replace it by "
                "hinges"
            )
    if not joints:
        raise ValueError(
            f"no joint moves the flange '{name}': name a body or site that a joint moves"
        )
    ids = tuple(model.joint(joint.name).id for joint in joints)
    return Chain(name, model.body(body.name).id, pose, ids)


def flanges(spec: mujoco.MjSpec) -> list[tuple[str, str, int]]:
    """Return the bodies and sites of a model that can be a robot's flange, those with the most
    joints first, each as "body" or "site", its name, and the number of joints that move it.

    The hand is the last body of the longest chain of joints before a gripper. Bodies and sites are
    left out if they have no name, if a gripper moves them, or if they are moved by fewer than six
    joints and by fewer joints than the hand is. If a single part moves beyond the hand, and its
    name is not that of a jaw, it is kept: it may be a link.
    """
    hand = _hand(spec)
    most = len(_joints(hand))
    moved = _moving(hand)
    gripped = {body.name for part in moved for body in _subtree(part)}
    if len(moved) == 1 and not _is_named_jaw(moved[0], is_last=True):
        gripped.remove(moved[0].name)
    bodies = [body for body in _subtree(spec.worldbody)[1:] if body.name not in gripped]
    sites = [("site", site.name, len(_joints(body))) for body in bodies for site in body.sites]
    found = [*sites, *(("body", body.name, len(_joints(body))) for body in bodies)]
    least = min(ALL_WAYS, most) or 1
    return sorted((f for f in found if f[1] and f[2] >= least), key=lambda f: -f[2])


def _default(spec: mujoco.MjSpec) -> str:
    """Return the name of the flange for a model without a setting: the only site of the tool at the
    end of the longest chain, or else the tool's body.
    """
    body = _tool(_hand(spec))
    sites = [site.name for site in body.sites if site.name]
    return sites[0] if len(sites) == 1 else body.name


def _hand(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """Return the hand of a robot: the last body of its longest chain of joints, or the body on this
    chain that carries fingers or a jaw.
    """
    body = spec.worldbody
    while moving := _moving(body):
        longest = max(moving, key=_depth)
        above = len(_joints(body))
        branches = len(moving) > 1 and (above >= ALL_WAYS or above > _depth(longest))
        if above and (branches or _is_jaw(longest)):
            break
        body = longest
    return body


def _is_jaw(body: mujoco.MjsBody) -> bool:
    """Return whether a body is taken for a finger or jaw of its parent, the hand.

    The order of the rules is from certain to likely: names; a slide beyond a whole arm; a tool's
    frame on the hand. A hinge without any of these is taken for a joint of the arm.
    """
    is_last = _depth(body) == 1
    if _is_named_jaw(body, is_last=is_last):
        return True
    *arm, joint = [j.type for j in _joints(body)]
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    if is_last and joint == slide and arm.count(mujoco.mjtJoint.mjJNT_HINGE) >= HINGES:
        return True
    # A flange or a tool on the body itself says that it is a link of the arm.
    has_tool = any(map(TOOL.search, _frames(body.parent)))
    return is_last and has_tool and bool(body.joints) and not _frames(body)


def _is_named_jaw(body: mujoco.MjsBody, *, is_last: bool) -> bool:
    """Return whether the name of a body or of its joint is that of a jaw; `is_last` is true if no
    further joint follows.
    """
    if len(body.joints) != 1:
        return False
    joints = _joints(body)
    *arm, joint = [j.name for j in joints]
    # Of a robot that is a finger all joints and bodies are named so.
    moves_jaw = _grips(joint) and not any(map(_grips, arm))
    is_finger = FINGER.search(body.name) and not FINGER.search(joints[0].parent.name)
    return moves_jaw or bool(is_last and is_finger and not TURNS.search(joint))


def _grips(joint: str) -> bool:
    return bool(GRIPS.search(joint) and not TURNS.search(joint))


def _tool(hand: mujoco.MjsBody) -> mujoco.MjsBody:
    """Return the outermost body that is fixed to a hand, found from the hand outwards: a child with
    the name of a tool's frame, or else an only child. Without such a child it is the hand itself.
    """
    body = hand
    while children := body.bodies:
        tools = [c for c in children if not _depth(c) and TOOL.search(c.name)]
        if tools:
            # ROS-Industrial's tool0 looks out of the robot, ee_link across.
            body = next((c for c in tools if OUTWARD.search(c.name)), tools[0])
        elif len(children) == 1 and not _depth(children[0]):
            body = children[0]
        else:
            break
    return body


def _frames(body: mujoco.MjsBody) -> list[str]:
    """Return the names of the bodies and sites that are fixed to a body, without a joint
    between.
    """
    fixed = [child.name for child in body.bodies if not child.joints]
    return [*fixed, *(site.name for site in body.sites)]


def _joints(body: mujoco.MjsBody) -> list[mujoco.MjsJoint]:
    """Return the joints between the base and a body, that of the base first, that of the body
    last.
    """
    return [*_joints(body.parent), *body.joints] if body.parent else []


def _depth(body: mujoco.MjsBody) -> int:
    """Return the largest number of joints on a chain that begins with a body's own joints."""
    return len(body.joints) + max(map(_depth, body.bodies), default=0)


def _moving(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """Return the children of a body that a joint moves, or that carry bodies with joints."""
    return [child for child in body.bodies if _depth(child)]


def _subtree(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """Return a body and all that it carries, in the order of the compiled model."""
    return [body, *itertools.chain.from_iterable(map(_subtree, body.bodies))]


def _near(spec: mujoco.MjSpec, name: str) -> str:
    known = [found for _, found, _ in flanges(spec)]
    near = get_close_matches(name, known, n=1)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"there is {', '.join(known)}" if known else "nothing is moved by joints"
