"""Conversion of any robot model into one that carries a camera: with velocity drives, and without
gravity and contacts.
"""

from collections.abc import Sequence
from itertools import chain

import mujoco
import numpy as np

from sim.camera.camera import FOVY
from sim.kinematics.chain import Chain, chain_to, name_all
from sim.kinematics.drives import (
    SPEEDS,
    add_drives,
    forces_of,
    has_velocity_drives,
    kind_of_joint,
    own_speed,
)
from sim.models.model_files import SIMULATION, compiled, leave_out
from sim.models.quaternion import quaternion_of
from sim.mounting import EYE
from sim.types import Array, Pose

FARTHEST = 10_000.0
"""A limit is nearer than this [m, rad or deg]: exporters write infinity or 1e20 for none."""
WORDS = {
    mujoco.mjtEq.mjEQ_CONNECT: "connection",
    mujoco.mjtEq.mjEQ_WELD: "weld",
    mujoco.mjtEq.mjEQ_JOINT: "coupling (mimic)",
    mujoco.mjtEq.mjEQ_TENDON: "coupling",
}
"""Constraints that a robot may have, as messages call them."""


def camera_chain(spec: mujoco.MjSpec, flange: str, camera: str) -> tuple[mujoco.MjModel, Chain]:
    """Return the compiled form of a robot's model, and the chain of joints between its base and the
    flange or the camera.

    Args:
        spec: The model, which is changed: unnamed bodies and joints get names, infinite limits are
            removed or, if the other limit is finite, cut to 10,000 [m, rad or deg], and static
            bodies are kept.
        flange: Name of a body or site; an empty text selects the end of the longest chain.
        camera: Name of a camera of the model to use instead of the flange, or an empty text.

    Raises:
        ValueError: The flange or camera is missing, no joint moves it, a ball joint does, the model
            has a free joint, or MuJoCo refuses the model.
    """
    name_all(spec)
    spec.compiler.fusestatic = False  # the flange may be any body
    for joint in spec.joints:
        _end_limits(joint)
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            raise ValueError(
                f"the body '{joint.parent.name}' has a free joint: remove the joint or the body"
            )
    model = compiled(spec.copy())
    if not camera:
        return model, chain_to(spec, model, flange)
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
    if found < 0:
        names = [model.camera(i).name for i in range(model.ncam)]
        there = f"there is {', '.join(names)}" if names else "it has none"
        raise ValueError(f"there is no camera '{camera}' in the model; {there}")
    return model, chain_to(spec, model, model.body(model.cam_bodyid[found]).name)


def make_robot(
    spec: mujoco.MjSpec, model: mujoco.MjModel, carried: Chain, camera: str, mount: Pose
) -> tuple[str, ...]:
    """Turn a model, in place, into a robot with a camera and a site, both called `eye`, at the end
    of a chain of joints; return the names of the chain's joints, the base's first.

    Args:
        spec: The model, which is changed: all other joints, lights, floors, sensors, tendons and
            constraints are deleted, and contacts and gravity are switched off. The drives of the
            chain stay if each of its joints has exactly one drive, a velocity servo; else all
            drives are deleted.
        model: The same model, compiled.
        carried: The chain of joints that moves the camera.
        camera: Name of the model's camera, which is renamed to `eye`; an empty text adds one.
        mount: T_flange_camera of an added camera (x right, y down, z forward).

    Raises:
        ValueError: The camera does not move with its body, or a constraint acts on joints of the
            chain.
    """
    names = tuple(model.joint(j).name for j in carried.joints)
    carrier = model.body(carried.body).name
    _check_loops(spec, model, carried)
    _strip(spec, names, keep_drives=has_velocity_drives(model, carried.joints))
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    for body in spec.bodies:
        body.gravcomp = 1.0
    if camera:
        found = model.camera(camera)
        if model.cam_mode[found.id] != mujoco.mjtCamLight.mjCAMLIGHT_FIXED:
            raise ValueError(
                f"the mode of the camera '{camera}' is not fixed: set it to fixed, so that the "
                "camera moves with its body"
            )
        _place_eye(spec, carrier, found.pos, found.quat, camera)
    else:
        pose = carried.pose @ mount
        w, x, y, z = quaternion_of(pose.rotation).tolist()
        # MuJoCo's cameras look along -z, with y up: turned by pi about x, without rounding.
        _place_eye(spec, carrier, pose.translation, [-x, w, z, -y])
    return names


def drive(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    joints: Sequence[int],
    speeds: Sequence[float | None],
) -> None:
    """Set the largest rates of a robot's joints in its model. If the model has no velocity servos
    left, each joint gets one, with the force limits of the joint and of its former actuator, and
    loses its friction, damping and springs (see `add_drives`).

    Args:
        spec: The robot's model after `make_robot`; it is changed.
        model: The original model, compiled.
        joints: Ids of the robot's joints in the original model.
        speeds: Largest rate of each joint [m/s or rad/s]; None: that of the joint's velocity servo
            in the original model, which may be unlimited; for a new servo without such a limit, 2
            rad/s or 0.5 m/s.
    """
    names = [model.joint(j).name for j in joints]
    if spec.actuators:
        given = dict(zip(names, speeds, strict=True))
        for actuator in spec.actuators:
            if (speed := given[actuator.target]) is not None:
                actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
                actuator.ctrlrange = [-speed, speed]
        return
    usual = [own_speed(model, j) or SPEEDS[kind_of_joint(model.jnt_type[j])] for j in joints]
    chosen = [u if s is None else s for s, u in zip(speeds, usual, strict=True)]
    add_drives(spec, names, np.array(chosen), forces_of(model, joints))


def _end_limits(joint: mujoco.MjsJoint) -> None:
    """Remove a joint's range if both its limits are infinite; if only one is, replace this limit by
    -`FARTHEST` or `FARTHEST`. Limits of 10,000 or more count as infinite.
    """
    near = np.abs(joint.range) < FARTHEST
    if not near.any():
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.range = [0, 0]
    elif not near.all():
        joint.range = np.where(near, joint.range, [-FARTHEST, FARTHEST])


def _check_loops(spec: mujoco.MjSpec, model: mujoco.MjModel, carried: Chain) -> None:
    """Refuse constraints on the joints that carry the camera; those of a gripper do not matter.

    Raises:
        ValueError: A connection, weld or coupling acts on one of these joints.
    """
    for constraint in (each for each in spec.equalities if each.type in WORDS):
        ends = [name for name in (constraint.name1, constraint.name2) if name]
        held = chain.from_iterable(_joints_held(model, constraint, end) for end in ends)
        if not set(carried.joints).isdisjoint(held):
            name = f" '{constraint.name}'" if constraint.name else ""
            raise ValueError(
                f"the {WORDS[constraint.type]}{name} of {' and '.join(map(repr, ends))} closes a "
                "loop or couples joints between base and flange, which have to move independently: "
                "remove the constraint"
            )


def _joints_held(model: mujoco.MjModel, constraint: mujoco.MjsEquality, end: str) -> list[int]:
    """Return the ids of the joints on which a constraint acts at one of its ends, by the name of
    the joint, tendon, body or site.
    """
    if constraint.type == mujoco.mjtEq.mjEQ_JOINT:
        return [model.joint(end).id]
    if constraint.type == mujoco.mjtEq.mjEQ_TENDON:
        tendon = model.tendon(end).id
        first = model.tendon_adr[tendon]
        wraps = slice(first, first + model.tendon_num[tendon])
        is_joint = model.wrap_type[wraps] == mujoco.mjtWrap.mjWRAP_JOINT
        return model.wrap_objid[wraps][is_joint].tolist()
    is_site = constraint.objtype == mujoco.mjtObj.mjOBJ_SITE
    body = model.site(end).bodyid if is_site else model.body(end).id
    # A joint moves all bodies that are fixed to its own.
    return np.flatnonzero(model.body_weldid[model.jnt_bodyid] == model.body_weldid[body]).tolist()


def _strip(spec: mujoco.MjSpec, joints: Sequence[str], *, keep_drives: bool) -> None:
    """Delete all joints of a model that are not named, so that grippers do not move; also its
    lights and floors, and its drives, or with `keep_drives` only those of the deleted joints.
    """
    leave_out(spec, SIMULATION)
    drives = (a for a in spec.actuators if not keep_drives or a.target not in joints)
    floors = (g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_PLANE)
    others = (j for j in spec.joints if j.name not in joints)
    for item in list(chain(drives, floors, others)):
        spec.delete(item)


def _place_eye(
    spec: mujoco.MjSpec, body: str, pos: Array, quat: Sequence[float], camera: str = ""
) -> None:
    """Rename a camera of the model to `eye`, or add a camera of this name to a body; add a site
    `eye` at the same place. Other cameras and sites called `eye` are deleted.

    Args:
        spec: The model, which is changed.
        body: Name of the body.
        pos: Position (3,) of the site, and of an added camera, on the body [m].
        quat: Their orientation, a quaternion (w, x, y, z).
        camera: Name of the model's camera; an empty text adds one.
    """
    others = [c for c in spec.cameras if c.name == EYE != camera]
    for item in [*others, *(s for s in spec.sites if s.name == EYE)]:
        spec.delete(item)
    eye = spec.camera(camera) if camera else spec.body(body).add_camera(pos=pos, quat=quat)
    if not camera:
        eye.fovy = FOVY  # whatever the model's defaults say of its own cameras
    eye.name = EYE
    spec.body(body).add_site(name=EYE, pos=pos, quat=quat, size=[0.005] * 3, rgba=[0] * 4)
