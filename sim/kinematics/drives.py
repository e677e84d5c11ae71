"""Velocity drives for robots whose models have other actuators; gains are computed from the robot's
inertia.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.models.model_files import compiled
from sim.types import Array

TIME_CONSTANT = 0.015
"""Time in which a joint takes a new rate [s]: several steps of physics, and half a frame."""
ARMATURE = {"hinge": 0.01, "slide": 0.1}
"""Least inertia of a geared motor, as seen by its joint [kg m^2 or kg]."""
GEARED = 0.5
"""Least inertia of the motor over that of all that it moves: with less the joints of a stretched
arm drag each other along."""
SPEEDS = {"hinge": 2.0, "slide": 0.5}
"""Largest rate of a joint whose model has none [rad/s or m/s]."""
FULL_SPEED_AFTER = 0.25
"""A force limit of the model is kept where it allows full speed within this time [s]."""
ON_JOINTS = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
SAMPLES = 64
"""Postures of which the largest inertia counts."""


def has_velocity_drives(model: mujoco.MjModel, joints: Sequence[int]) -> bool:
    """Return True if each of the given joints (by id) has exactly one actuator, a velocity
    servo.
    """
    return all(_servo_of(model, joint) is not None for joint in joints)


def own_speed(model: mujoco.MjModel, joint: int) -> float | None:
    """Return the largest rate [m/s or rad/s] that the velocity servo of a joint (by id) makes in
    both directions, the smaller one of the magnitudes of its two limits. Return None if the joint
    has no such servo, or the servo no limits.
    """
    servo = _servo_of(model, joint)
    if servo is None or not model.actuator_ctrllimited[servo]:
        return None
    return float(np.abs(model.actuator_ctrlrange[servo]).min())


def _servo_of(model: mujoco.MjModel, joint: int) -> int | None:
    """Return the id of the only actuator of a joint if it is a velocity servo; else None."""
    drive = drive_of(model, joint)
    return drive if drive is not None and wrong_drive(model, drive) is None else None


def drive_of(model: mujoco.MjModel, joint: int) -> int | None:
    """Return the id of the actuator of a joint (by id); None if the joint has none or several."""
    on_joints = model.actuator_trntype[:, None] == [int(kind) for kind in ON_JOINTS]
    found = np.flatnonzero(on_joints.any(axis=1) & (model.actuator_trnid[:, 0] == joint))
    return int(found[0]) if len(found) == 1 else None


def wrong_drive(model: mujoco.MjModel, actuator: int) -> str | None:
    """Return why an actuator (by id) is not a velocity servo of one joint, with gear 1, that can
    drive in both directions, as the end of a sentence whose subject is the actuator; None if it is
    one.
    """
    gain = model.actuator_gainprm[actuator, 0]
    bias = model.actuator_biasprm[actuator, :3]
    on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    if not on_joint or model.actuator_gear[actuator, 0] != 1:
        return "does not drive one joint with gear 1: give it a joint, and gear 1"
    if gain <= 0 or not np.array_equal(bias, [0.0, 0.0, -gain]):
        return "is not a <velocity> servo: replace it by one"
    low, high = model.actuator_ctrlrange[actuator]
    if model.actuator_ctrllimited[actuator] and not low < 0 < high:
        return f"has the ctrlrange {low:g} {high:g}, which does not allow both directions: widen it"
    return None


def add_drives(spec: mujoco.MjSpec, names: Sequence[str], speeds: Array, forces: Array) -> None:
    """Add a velocity servo to each joint of a model. Friction, damping, springs and force limits of
    the joints are removed, and the inertia of their motors (armature) is raised to half of the
    largest inertia that they move, at least to 0.01 kg m^2 (hinges) or 0.1 kg (slides).

    Args:
        spec: A model without actuators and without further joints; it is changed.
        names: Names of its joints.
        speeds: Largest rates of the joints (n,) [rad/s or m/s].
        forces: Largest force or torque of each joint (n,) [N or N m]; inf for unlimited ones. One
            that does not allow the full speed within 0.25 s is ignored.
    """
    for name in names:
        joint = spec.joint(name)
        joint.damping = np.zeros(3)
        joint.stiffness = np.zeros(3)
        joint.frictionloss = 0.0
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for name, moved, speed, force in zip(names, _inertia(spec), speeds, forces, strict=True):
        joint = spec.joint(name)
        # A strong motor inertia decouples the joints: see GEARED.
        motor = max(joint.armature, GEARED * moved, ARMATURE[kind_of_joint(joint.type)])
        inertia = moved - joint.armature + motor
        joint.armature = motor
        drive = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=[1, 0, 0, 0, 0, 0]
        )
        drive.set_to_velocity(inertia / TIME_CONSTANT)
        drive.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
        drive.ctrlrange = [-speed, speed]
        if inertia * speed / FULL_SPEED_AFTER <= force < np.inf:
            drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            drive.forcerange = [-force, force]


def forces_of(model: mujoco.MjModel, joints: Sequence[int]) -> Array:
    """Return the largest force [N] or torque [N m] that each of the given joints (by id) can exert
    in both directions (n,): the smaller one of the joint's own limit and that of its actuator,
    which counts if it is the joint's only one; inf without a limit.
    """
    forces = np.full(len(joints), np.inf)
    for k, joint in enumerate(joints):
        if model.jnt_actfrclimited[joint]:
            forces[k] = np.abs(model.jnt_actfrcrange[joint]).min()
        drive = drive_of(model, joint)
        if drive is not None and model.actuator_forcelimited[drive]:
            geared = np.abs(model.actuator_forcerange[drive] * model.actuator_gear[drive, 0])
            forces[k] = min(forces[k], geared.min())
    return forces


def kind_of_joint(joint_type: int) -> str:
    """Return "slide" for MuJoCo's type (mjtJoint) of a slide joint, and "hinge" for any other
    type.
    """
    return "slide" if joint_type == mujoco.mjtJoint.mjJNT_SLIDE else "hinge"


def random_joints(
    model: mujoco.MjModel,
    joints: Sequence[int] | NDArray[np.intp],
    rng: np.random.Generator,
    count: int,
) -> Array:
    """Return `count` random positions (count, n) of n joints (by id) [rad or m], uniform within the
    joints' limits; of joints without limits, hinges within -pi..pi rad and slides within -1..1 m.
    """
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    slides = (model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE)[:, None]
    free = np.where(slides, [-1.0, 1.0], [-np.pi, np.pi])
    low, high = np.where(limited, model.jnt_range[joints], free).T
    return rng.uniform(low, high, (count, len(joints)))


def _inertia(spec: mujoco.MjSpec) -> Array:
    """Return the largest inertia (n,) seen by each joint in random postures, with the other joints
    held [kg m^2 or kg].
    """
    model = compiled(spec)
    data = mujoco.MjData(model)
    whole = np.empty((model.nv, model.nv))
    largest = np.zeros(model.nv)
    for q in random_joints(model, range(model.njnt), np.random.default_rng(0), SAMPLES):
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        # With the others held, a joint sees its diagonal entry of the mass matrix.
        mujoco.mj_fullM(model, data, whole)
        largest = np.maximum(largest, np.diag(whole))
    return largest
