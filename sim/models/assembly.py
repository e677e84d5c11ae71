"""The whole scene: a robot and a target attached to the model of the room, compiled for a
camera.
"""

import copy
from collections.abc import Iterable
from importlib import resources

import mujoco
import numpy as np

from sim.camera.camera import CameraConfig
from sim.geometry import VISION_FROM_MUJOCO
from sim.kinematics.robot import Design
from sim.leader import Leader
from sim.models.model_files import compiled
from sim.models.quaternion import quaternion_of
from sim.models.target import Target
from sim.mounting import CAMERA
from sim.surroundings import TABLE, Surroundings
from sim.types import Array, Pose

ROBOT = "robot"
TARGET = "target"
SECOND = "second_target"
LEADER = "leader"
"""Names in the scene: the robot's begin with "robot/"; the others are bodies of these names."""
SPOT = "spot"
"""The prop of a light that is not the same everywhere: MuJoCo lights corners and blends between
them, so the table needs more of them."""
FINE_QUADS = 8
"""MuJoCo's `numquads` then; its default is 4."""
FLOOR = "floor"
STANDS = 4
"""A group of geoms that MuJoCo does not draw by itself: no camera on a robot sees them."""
STAND: dict[str, object] = {
    "group": STANDS,
    "rgba": [0.18, 0.19, 0.21, 1.0],
    "contype": 0,
    "conaffinity": 0,
    "mass": 0,
}
"""What robots and cameras stand on; only films and recordings show it."""
PEDESTAL = 0.08
TRIPOD = 0.02
"""Radii of the columns [m]."""
CAMERA_BODY = (0.03, 0.025, 0.04)
"""Half sides of the body of a camera in the room [m]."""


def build_model(
    physics_rate: float,
    camera: CameraConfig,
    robot: Design,
    target: Target,
    props: Iterable[str] = (),
    surroundings: Surroundings | None = None,
    leader: Leader | None = None,
) -> mujoco.MjModel:
    """Return the compiled MuJoCo model of a scene: the room, with a robot and a target in it.

    Args:
        physics_rate: Physics steps a second [Hz].
        camera: Settings of the camera, of which only the field of view is used.
        robot: The robot that carries the camera or the target.
        target: The target.
        props: Names of the things that disturbances need in the scene: "second_target", a copy of
            the target; and "spot", a finer lighting of the table for a spot light.
        surroundings: Ground, walls, clutter and light; None: as they are in the room's model.
        leader: The moving tag beside which the robot is to keep the target; None: no such tag.

    Raises:
        ValueError: MuJoCo refuses the model, a picture of the surroundings cannot be read, or the
            colour of the light is not valid.
    """
    wanted = set(props)
    with resources.as_file(resources.files("scenes")) as folder:
        room = mujoco.MjSpec.from_file(str(folder / "room.xml"))
        _attach_robot(room, robot, camera)
        if surroundings is not None:
            surroundings.furnish(room, target.spec)
        # An attached model cannot be copied any more.
        models = {TARGET: target.spec.copy()}
        if SECOND in wanted:
            models[SECOND] = target.spec.copy()
        if leader is not None:
            models[LEADER] = leader.tag.spec.copy()
        for name, model in models.items():
            body = room.worldbody.add_body(name=name, mocap=True)
            room.attach(model, prefix=f"{name}/", frame=body.add_frame())
        if SPOT in wanted:
            room.visual.quality.numquads = FINE_QUADS
        room.option.timestep = 1.0 / physics_rate
        model = compiled(room)
        if robot.mounting.standing is not None:
            _put_camera(model, robot.mounting.standing)
        return model


def _put_camera(model: mujoco.MjModel, T_world_camera: Pose) -> None:
    """Move the camera from the robot's hand to a pose in the room."""
    camera = model.camera(CAMERA).id
    model.cam_bodyid[camera] = 0
    model.cam_pos[camera] = T_world_camera.translation
    model.cam_quat[camera] = quaternion_of(T_world_camera.rotation @ VISION_FROM_MUJOCO)


def with_stands(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of the scene's model in which the robot's pedestal and the tripod of a camera
    in the room are visible; the cameras of a run do not see them.
    """
    drawn = copy.copy(model)
    drawn.geom_group[drawn.geom_group == STANDS] = 0
    return drawn


def _attach_robot(room: mujoco.MjSpec, robot: Design, camera: CameraConfig) -> None:
    """Attach a robot's model to the room's model, at the robot's base, with the lag of its drives
    and the camera's field of view, and add the stands of robot and camera. The robot's camera is
    then called `CAMERA`, "robot/eye".
    """
    base = robot.base
    frame = room.worldbody.add_frame(pos=base.translation, quat=quaternion_of(base.rotation))
    spec = robot.spec.copy()
    lag = robot.drives.lag_ms / 1e3
    if lag > 0:
        for drive in spec.actuators:
            drive.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            drive.dynprm[0] = lag
    room.attach(spec, prefix=f"{ROBOT}/", frame=frame)
    if camera.fovy_deg is not None:
        room.camera(CAMERA).fovy = camera.fovy_deg
    _put_on_stand(room, base.translation, PEDESTAL)
    at = robot.mounting.standing
    if at is not None:
        _put_on_stand(room, at.translation, TRIPOD)
        room.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=CAMERA_BODY,
            pos=at.apply(np.array([0.0, 0.0, -CAMERA_BODY[2]])),
            quat=quaternion_of(at.rotation),
            **STAND,
        )


def _put_on_stand(room: mujoco.MjSpec, top: Array, radius: float) -> None:
    """Put a column under a point (3,) [m], from the table or the floor up, if it is above these."""
    table = room.geom(TABLE)
    on_table = (np.abs(top[:2]) < table.size[:2]).all()
    foot = 0.0 if on_table else float(room.geom(FLOOR).pos[2])
    half = (float(top[2]) - foot) / 2
    if half > 0:
        room.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, half, 0],
            pos=[*top[:2], foot + half],
            **STAND,
        )
