"""The scene put together: a robot and a target attached to the room, compiled for a camera."""

from collections.abc import Iterable
from importlib import resources

import mujoco

from sim.camera.camera import FOVY, CameraConfig
from sim.kinematics.robot import CAMERA, Design
from sim.models.model_files import compiled
from sim.models.quaternion import quaternion_of
from sim.models.target import Target
from sim.surroundings import Surroundings

ROBOT = "robot"
TARGET = "target"
SECOND = "second_target"
"""Names in the scene: the robot's begin with "robot/"; the targets are bodies of these names."""
SPOT = "spot"
"""The prop of a light that is not the same everywhere: MuJoCo lights corners and blends between
them, so the table needs more of them."""
FINE_QUADS = 8


def build_model(
    physics_rate: float,
    camera: CameraConfig,
    robot: Design,
    target: Target,
    props: Iterable[str] = (),
    surroundings: Surroundings | None = None,
) -> mujoco.MjModel:
    """The room with the robot and the target in it, compiled for a camera.

    Args:
        physics_rate: Physics steps a second [Hz].
        camera: Size of the pictures and field of view.
        robot: What carries the camera.
        target: What is followed.
        props: What the disturbances need: "second_target", "spot".
        surroundings: Ground, clutter and light; by default as they are in the room's model.
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
        for name, model in models.items():
            body = room.worldbody.add_body(name=name, mocap=True)
            room.attach(model, prefix=f"{name}/", frame=body.add_frame())
        if SPOT in wanted:
            room.visual.quality.numquads = FINE_QUADS
        room.option.timestep = 1.0 / physics_rate
        return compiled(room)


def _attach_robot(room: mujoco.MjSpec, robot: Design, camera: CameraConfig) -> None:
    """The camera's name is then CAMERA."""
    base = robot.base
    frame = room.worldbody.add_frame(pos=base.translation, quat=quaternion_of(base.rotation))
    spec = robot.spec.copy()
    lag = robot.drives.lag_ms / 1e3
    if lag > 0:
        for drive in spec.actuators:
            drive.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            drive.dynprm[0] = lag
    room.attach(spec, prefix=f"{ROBOT}/", frame=frame)
    room.camera(CAMERA).fovy = camera.fovy_deg or FOVY
