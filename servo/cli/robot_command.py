"""The command `servobench robot`: print a robot's joints, its reach and its [robot] table for a
scenario, and draw it in the room.
"""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
import dataclasses
import itertools
import json
from math import degrees, isfinite
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from servo.cli.outputs import check_writable
from servo.cli.terminal import plain, print_table
from servo.mistake import Mistake, check_suffix, writing
from servo.output.room_view import RoomView
from servo.report.words import Table
from servo.scenario.fill import fill
from servo.types import DOF
from sim.camera.camera import CameraConfig, pinhole
from sim.camera.choice import renderer_of
from sim.camera.renderer import MakeRenderer, Unseen
from sim.kinds import PartConfig, kind_of
from sim.kinematics.chain import ALL_WAYS, Chain, flanges
from sim.kinematics.doubts import doubts
from sim.kinematics.drives import drive_of, has_velocity_drives, kind_of_joint
from sim.kinematics.inverse_kinematics import Reach
from sim.kinematics.model import camera_chain
from sim.kinematics.robot import Robot
from sim.kinematics.rollout import STEP
from sim.kinematics.workspace import Workspace, movable_shares, sample_workspace
from sim.models.assembly import ROBOT
from sim.models.model_reader import read_spec
from sim.motions import circle, line, still, wander
from sim.mounting import CAMERA
from sim.robots import mjcf
from sim.stage import Motion
from sim.targets import car
from sim.types import Array, Image, Pose
from sim.world import World, WorldParts
from tracking.drawing.picture_bytes import encoded

DEPTH = 1.0
"""Distance of the camera from the target at the start of a scenario, by default [m]."""
PICTURE = CameraConfig(width=640, height=480)
SHOWN = 12
"""Largest number of candidates for the flange that are printed."""
POSITION = 1
RATE = 2
"""Indices of the position and the velocity feedback in an actuator's bias."""

BESIDE = (0.0, -DEPTH, 0.0, 90.0)
"""Base (x, y, z [m], yaw [deg]) of a robot that cannot bring the camera above the target, but sees
the target from the side."""
MOTIONS = (line.Config(), circle.Config(), wander.Config())
DRIVEN = 10.0
"""Duration of these motions, as in a scenario by default [s]."""
NO_BASE = "No base was found from which a run can begin: give --base, or turn the camera (--mount)."
FEW = (
    "Whether so few joints can follow a motion is not known before a run: from this base it may "
    "lose the target or end at a joint's limit, even while the target stands still."
)
ASIDE = f"No base was found from which the camera begins {DEPTH:g} m above the target. "
NEAR = 0.01
"""Largest distance from a pose at which the camera counts as there [m]."""
LEAST_SHARE = 0.05
"""Smaller shares of a twist's components are not printed."""


def run(out: Path | None, **options: object) -> None:
    """Print the joints, flanges, reach and the [robot] table of a robot's model, and draw the robot
    in the room.

    Args:
        out: The PNG to write; None: the first free one of robot.png, robot-2.png and so on.
        **options: Settings of the table [robot] by name, of which `model` is required; those that
            are empty are left at their defaults.

    Raises:
        Mistake: The model cannot be used, a setting does not fit it, or `out` exists or is not a
            PNG.
    """
    given = {key: value for key, value in options.items() if value}
    names = (Path(f"robot-{k}.png" if k > 1 else "robot.png") for k in itertools.count(1))
    out = out or next(name for name in names if not name.exists())
    check_suffix(out, ".png")
    check_writable(out)
    if str(given["model"]).endswith(".toml"):
        raise Mistake(
            f"robot: {given['model']}: this is a scenario; give the robot's model file (MJCF or "
            "URDF), which the scenario's table [robot] names as model"
        )
    console = Console()
    config = fill(mjcf.Config, given, "robot")
    try:
        spec = read_spec(mjcf.model_path(config.model), mjcf.WHAT, whole=False)
        model, chain = camera_chain(spec, config.flange, config.camera)
        if not given.keys() & {"flange", "mount", "camera"}:
            config = dataclasses.replace(config, camera=_own_camera(model))
            model, chain = camera_chain(spec, config.flange, config.camera)
        robot = _world(dataclasses.replace(config, base=(0.0, 0.0, 0.0, 0.0)), Unseen).robot
        workspace = sample_workspace(robot, DEPTH)
        bases = [config.base] if "base" in given else [workspace.base, BESIDE]
        proposed = next((base for base in bases if _begins(config, base)), None)
        config = dataclasses.replace(config, base=proposed or bases[0])
        picture, view = _drawn(config)
        ranges = [_ranges_text(config)] if proposed else []
    except ValueError as error:
        raise Mistake(f"robot: {error}") from None
    print_table(console, _joint_table(model, chain, robot))
    print_table(console, _flange_table(spec, chain))
    table = _toml(config, chain) if proposed or "base" in given else NO_BASE
    text = "\n".join([_reach_text(workspace), *doubts(robot), view, *ranges])
    plain(console, f"{text}\n\n{table}\n")
    with writing(out, "this picture"):
        out.write_bytes(encoded(picture))
    plain(console, str(out))


def _world(
    config: mjcf.Config,
    renderer: MakeRenderer | None = None,
    motion: PartConfig[Motion] | None = None,
) -> World:
    """Return a simulated world with a robot, and a car as the target, which stands still without a
    motion.
    """
    rng = np.random.default_rng(0)
    moved = (motion or still.Config()).build(rng)
    parts = WorldParts(config.build(rng), car.Config().build(rng), moved, camera=PICTURE)
    return World(parts, rng, renderer=renderer)


def _own_camera(model: mujoco.MjModel) -> str:
    """Return the name of the only camera of the model that joints move; empty if there are more or
    none.
    """
    moved = [i for i in range(model.ncam) if model.body_weldid[model.cam_bodyid[i]]]
    return model.camera(moved[0]).name if len(moved) == 1 else ""


def _begins(config: mjcf.Config, base: tuple[float, float, float, float]) -> bool:
    """Return whether a run can begin from a base (x, y, z [m], yaw [deg]).

    The camera must be at its pose 1 m above the target within 1 cm; from the base `BESIDE`, any
    pose will do from which the camera sees the target.
    """
    reach = _begun(dataclasses.replace(config, base=base), still.Config())
    return reach.there and (reach.distance < NEAR or base == BESIDE)


def _begun(config: mjcf.Config, motion: PartConfig[Motion]) -> Reach:
    """Return how near the start of a run comes to the camera pose 1 m above the target, and whether
    the joints can follow a motion of the target from there.
    """
    world = _world(config, Unseen, motion)
    facing = Pose(np.eye(3), np.array([0.0, 0.0, DEPTH]))
    times = np.arange(0.0, DRIVEN, STEP).tolist()
    middle = np.array([PICTURE.width, PICTURE.height]) / 2
    return world.start(
        middle, 0.0, DEPTH, way=lambda: [world.eye_at_goal(t, facing, turns=True) for t in times]
    )


def _ranges_text(config: mjcf.Config) -> str:
    """Return a sentence that says, for each of the target's motions line, circle and wander,
    whether the joints can follow it inside their ranges; if this is not known before a run, because
    the robot has too few joints, return sentences that say so.
    """
    found = list[str]()
    for motion in MOTIONS:
        reach = _begun(config, motion)
        if reach.there and reach.rollout is None:
            return f"{ASIDE if config.base == BESIDE else ''}{FEW}"
        sentence = "begins out of the robot's reach"
        if reach.rollout is not None:
            joint = reach.rollout.joint
            sentence = "keeps all joints inside their ranges"
            if joint:
                sentence = f"takes {joint} to the end of its range in {reach.rollout.time:.1f} s"
        found.append(f"{kind_of(motion)} {sentence}")
    return f"Motions with default settings: {'; '.join(found)}."


def _drawn(config: mjcf.Config) -> tuple[Image, str]:
    """Return a picture of the room with the camera's picture at its right, RGB (H, W, 3), and
    sentences about the camera's start.
    """
    world = _world(config)
    model = world.model
    size = PICTURE.width, PICTURE.height
    room = RoomView(model, *size)
    eye = renderer_of(CameraConfig())(model, CAMERA, pinhole(model, CAMERA, *size))
    try:
        reach = world.start(np.array(size) / 2, 0.0, DEPTH)
        own = np.array([_belongs(model, i) for i in range(model.ngeom)])
        room.fit(_corners(world, own))
        views = [room.render(world.bodies()), eye.begin(world.data)()]
        seen = eye.silhouette(world.data, own, alone=False)
    finally:
        for item in (room, eye, world):
            item.close()
    above = f"{DEPTH:g} m above the target"
    if not reach:
        text = f"From the base in the picture the camera does not get {above}: {reach}."
    elif reach.distance < NEAR:
        text = f"From the base below the camera can be {above}."
    else:
        away = f"{reach.distance:.2f} m and {degrees(reach.angle):.0f} deg"
        text = f"From the base below the camera sees the target, {away} from the pose {above}."
    if len(world.robot.ids) < ALL_WAYS:
        text += f"\n{_directions(world.robot.jacobian(world.data))}"
    if seen.any():
        share = 100 * seen.mean()
        text += (
            f"\nThe robot itself fills {share:.0f} % of the picture: move the camera with --mount."
        )
    return np.hstack(views), text


def _belongs(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom is part of the robot or its stand; all geoms of the room have names."""
    body = model.geom_bodyid[geom]
    name = model.body(body).name if body else model.geom(geom).name
    return name.startswith(f"{ROBOT}/") or not (body or name)


def _corners(world: World, geoms: NDArray[np.bool_]) -> Array:
    """Return the points (n, 3) in the world frame [m] that a view of the robot should show: the
    corners of the boxes around the geoms in a mask (ngeom,), and the table's middle.
    """
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    boxes = world.model.geom_aabb[geoms]
    local = boxes[:, None, :3] + signs * boxes[:, None, 3:]
    turned = world.data.geom_xmat[geoms].reshape(-1, 3, 3)
    places = np.einsum("gij,gkj->gki", turned, local) + world.data.geom_xpos[geoms, None]
    return np.vstack([places.reshape(-1, 3), np.zeros((1, 3))])


def _directions(jacobian: Array) -> str:
    """Return sentences that say which components of the camera's twist a robot with fewer than six
    joints can follow, and what a run then servoes.

    Args:
        jacobian: Camera twist per joint rate (6, n).
    """
    shares = zip(DOF, movable_shares(jacobian), strict=True)
    parts = ", ".join(f"{name} {100 * s:.0f} %" for name, s in shares if s > LEAST_SHARE)
    return (
        f"Its {jacobian.shape[1]} joint{'s' * (jacobian.shape[1] > 1)} can follow these components "
        f"of the camera's twist there, each if it alone is commanded: {parts}. They share the "
        "joints: no more components than joints can be followed at once. Of xn, yn, an and theta, "
        "a run servoes, in this order, those that the joints can move; of points or a pose it "
        "servoes all, as nearly as the joints can."
    )


def _joint_table(model: mujoco.MjModel, chain: Chain, robot: Robot) -> Table:
    """Return the table of all joints: range, largest rate, lag and actuator."""
    rows: list[list[str]] = []
    kept = has_velocity_drives(model, chain.joints)
    for joint in range(model.njnt):
        low, high = model.jnt_range[joint]
        place = chain.joints.index(joint) if joint in chain.joints else None
        unit = "" if place is None else f" {robot.units[place]}"
        limits = f"{low:.3g} .. {high:.3g}{unit}" if model.jnt_limited[joint] else "none"
        drive = ["held still", "", ""]
        if place is not None:
            fastest = robot.fastest[place]
            rate = f"{fastest:.3g}{unit}/s" if isfinite(fastest) else "none"
            lag = f"{1e3 * robot.servos()[place]:.1f} ms"
            drive = [rate, lag, _actuator(model, joint, kept=kept)]
        kind = kind_of_joint(model.jnt_type[joint])
        rows.append([model.joint(joint).name, kind, limits, *drive])
    head = ("joint", "type", "limits", "largest rate", "servo's lag", "actuator")
    return Table(head, rows, words=(0, 1))


def _actuator(model: mujoco.MjModel, joint: int, *, kept: bool) -> str:
    """Return a text about a joint's actuator: its type in the model's file, such as "position", and
    whether the simulation replaces it.
    """
    drive = drive_of(model, joint)
    if drive is None:
        return "none: one is added"
    if kept:
        return "velocity"
    bias = model.actuator_biasprm[drive]
    found = "position" if bias[POSITION] else "velocity" if bias[RATE] else "motor"
    return f"{found}: replaced"


def _flange_table(spec: mujoco.MjSpec, chain: Chain) -> Table:
    """Return the table of bodies and sites that may carry the camera."""
    found = flanges(spec)
    rows = [
        [name, f"{what}{' (taken)' * (name == chain.flange)}", str(joints)]
        for what, name, joints in found[:SHOWN]
    ]
    rows += [[f"and {len(found) - SHOWN} more"]] * (len(found) > SHOWN)
    return Table(("candidates for the flange", "", "joints"), rows, words=range(3))


def _reach_text(reach: Workspace) -> str:
    """Return a sentence about the distances and heights that the camera reaches [m]."""
    text = f"The camera reaches at most {reach.farthest:.2f} m from the base's origin"
    if not isfinite(reach.lowest):
        return f"{text}; it never looks down: turn it with --mount."
    heights = f"{reach.lowest:.2f} to {reach.highest:.2f} m"
    return f"{text}; where it looks down, it is {heights} above the base's origin."


def _toml(config: mjcf.Config, chain: Chain) -> str:
    """Return the [robot] table of a scenario, as TOML, for this robot."""
    flange = {"flange": chain.flange, "mount": list(config.mount)}
    carried = {"camera": config.camera} if config.camera else flange
    table = {"kind": "mjcf", "model": config.model, "base": list(config.base)} | carried
    lines = (f"{key} = {json.dumps(value)}" for key, value in table.items())
    return "\n".join(("[robot]", *lines))
