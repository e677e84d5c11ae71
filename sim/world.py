"""The world in one object: look at it, step it, and ask it for the truth."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Annotated, Protocol

import mujoco
import numpy as np
from annotated_types import Ge, Gt, Le

from sim import placement
from sim.geometry import log_se3
from sim.render import CameraConfig, Renderer, Sensor, camera_pose, pinhole
from sim.robot import EYE, Robot
from sim.types import Array, Effect, Frame, Image, Pose, Truth

OUTLINE = "target/outline"
TARGET = "target/car"
BOARD = "board"
BOARD_NEARNESS = 0.3
"""Where the board crosses the line of sight, as a fraction of the way from target to camera."""
WHOLE = 1e-9
"""Tolerance for a ratio of rates to count as whole."""


class Motion(Protocol):
    """Where the target is at any time."""

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        ...


class Disturbance(Protocol):
    """What disturbs the world at any time."""

    def at(self, time: float) -> Effect:
        """The effect at a time [s]."""
        ...


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """The simulated machine."""

    physics_rate: Annotated[float, Ge(240), Le(100_000)] = 480.0
    """Physics steps a second [Hz]."""
    drive_rate: Annotated[float, Gt(0)] = 120.0
    """How often the drives recompute joint rates from the twist [Hz]; once a frame at least."""
    visibility: bool = False
    """Measure the visible fraction of the target in each frame (two more renderings a frame)."""


def steps_between(physics_rate: float, rate: float, name: str) -> int:
    """Physics steps in one period of a rate.

    Raises:
        ValueError: They are not a whole number; the message gives both rates.
    """
    steps = physics_rate / rate
    if steps < 1 or abs(steps - round(steps)) > WHOLE * steps:
        raise ValueError(
            f"{name} = {rate:g} Hz does not divide world.physics_rate = {physics_rate:g} Hz "
            f"into whole steps ({steps:.6g} steps each)"
        )
    return round(steps)


def build_model(physics_rate: float, camera: CameraConfig) -> mujoco.MjModel:
    """The gantry's scene with the car in it, compiled for a camera."""
    scenes = resources.files("scenes")
    with resources.as_file(scenes) as folder:
        spec = mujoco.MjSpec.from_file(str(folder / "gantry.xml"))
        car = mujoco.MjSpec.from_file(str(folder / "car.xml"))
        spec.attach(car, prefix="target/", frame=spec.worldbody.add_frame())
        spec.option.timestep = 1.0 / physics_rate
        spec.camera(EYE).fovy = camera.fovy_deg
        spec.visual.global_.offwidth = camera.width * camera.supersample
        spec.visual.global_.offheight = camera.height * camera.supersample
        return spec.compile()


class World:
    """Gantry, camera, table and target. Built afresh for each episode; close it."""

    def __init__(
        self,
        config: WorldConfig,
        camera: CameraConfig,
        motion: Motion,
        disturbances: Sequence[Disturbance],
        rng: np.random.Generator,
    ) -> None:
        self._steps = steps_between(config.physics_rate, camera.rate, "camera.rate")
        self._drive_steps = steps_between(
            config.physics_rate, config.drive_rate, "world.drive_rate"
        )
        self.period = 1.0 / camera.rate
        self.model = build_model(config.physics_rate, camera)
        self.data = mujoco.MjData(self.model)
        self.robot = Robot(self.model)
        self.camera = pinhole(self.model, EYE, camera.width, camera.height)
        self._eye = self.model.camera(EYE).id
        self.outline = outline_of(self.model)
        self._motion, self._disturbances = motion, tuple(disturbances)
        self._visibility = config.visibility
        self._renderer = Renderer(self.model, EYE, camera.width, camera.height, camera.supersample)
        self._sensor = Sensor(camera, rng)
        self._exposed_at = exposure_steps(camera, self._steps)
        self._pictures: list[Image] = []
        self._frames = 0
        self._mean_twist = np.zeros(6)
        self._place_target(0.0)

    def close(self) -> None:
        """Give the renderer's GL context back."""
        self._renderer.close()

    def start(self, pixel: Array, theta: float, depth: float) -> bool:
        """Put the camera where it sees the target at a pixel, an angle and a depth; whether it can
        be there.
        """
        target = self._motion.at(0.0)
        heading = float(np.arctan2(target.rotation[1, 0], target.rotation[0, 0]))
        point = target.apply(self.outline.mean(axis=0))
        pose = placement.camera_above(self.camera, point, heading, pixel, theta, depth)
        reached = self.robot.solve(self.data, pose)
        mujoco.mj_forward(self.model, self.data)
        return reached

    def step(self, twist: Array) -> bool:
        """Hold a camera twist (6,) until the next frame; whether a joint limit or rate made it
        slower.
        """
        before = self._see()
        saturated = False
        for k in range(self._steps):
            if k in self._exposed_at:
                self._place_target(self.data.time)
                self._pictures.append(self._renderer.render(self.data))
            if k % self._drive_steps == 0:
                self.data.ctrl[:], slowed = self.robot.rates(self.data, twist)
                saturated |= slowed
            mujoco.mj_step(self.model, self.data)
        self._frames += 1
        self.data.time = self._frames * self.period
        self._place_target(self.data.time)
        self._mean_twist = log_se3(before.inverse() @ self._see()) / self.period
        return saturated

    def twist_measured(self) -> Array:
        """The camera's mean twist (6,) since the last frame, from its poses at both ends."""
        return self._mean_twist

    def look(self) -> Frame:
        """The picture as of now."""
        self._see()
        self._pictures.append(self._renderer.render(self.data))
        image = self._sensor.develop(self._pictures, self._effect(self.data.time).gain)
        self._pictures = []
        return Frame(image=image, time=self.data.time, index=self._frames)

    def truth(self) -> Truth:
        """Where the target is as of now, and how much of it is seen if that was asked for."""
        visible = self._visible() if self._visibility else None
        target = self._motion.at(self.data.time)
        return placement.truth(self.camera, self.outline, self._see(), target, visible)

    def truth_before(self) -> Truth:
        """The truth if the camera stood as now and the target where it was one frame ago."""
        target = self._motion.at(self.data.time - self.period)
        return placement.truth(self.camera, self.outline, self._see(), target)

    def describe_renderer(self) -> str:
        """The name the OpenGL driver gives itself."""
        return self._renderer.describe()

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the bodies that can move."""
        return tuple(self.model.body(i).name for i in range(1, self.model.nbody))

    def bodies(self) -> Array:
        """Poses (n, 3, 4) of the moving bodies in the world, [R | t]."""
        rotations = self.data.xmat[1:].reshape(-1, 3, 3)
        return np.concatenate([rotations, self.data.xpos[1:, :, None]], axis=2)

    def _see(self) -> Pose:
        # After mj_step the poses are one step old: refresh them, which costs microseconds.
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        return camera_pose(self.data, self._eye)

    def _effect(self, time: float) -> Effect:
        effect = Effect()
        for disturbance in self._disturbances:
            effect |= disturbance.at(time)
        return effect

    def _place_target(self, time: float) -> None:
        target = self._motion.at(time)
        self._place(TARGET, target)
        sideways = self._effect(time).board
        if sideways is not None:
            eye = self._see()
            point = target.translation + BOARD_NEARNESS * (eye.translation - target.translation)
            across = eye.rotation @ np.array([sideways, 0.0, 0.0])
            self._place(BOARD, Pose(Pose.planar(0, 0, 0).rotation, point + across))
        else:
            self.data.mocap_pos[self.model.body(BOARD).mocapid] = self.model.body(BOARD).pos

    def _place(self, body: str, pose: Pose) -> None:
        index = self.model.body(body).mocapid[0]
        self.data.mocap_pos[index] = pose.translation
        mujoco.mju_mat2Quat(self.data.mocap_quat[index], pose.rotation.flatten())

    def _visible(self) -> float:
        car = self.model.geom_bodyid == self.model.body(TARGET).id
        shadow = self.model.geom("target/shadow").id
        car[shadow] = False
        alone = self._renderer.silhouette(self.data, car, alone=True)
        return self._renderer.silhouette(self.data, car, alone=False) / alone if alone else 0.0


def outline_of(model: mujoco.MjModel) -> Array:
    """Corners (4, 3) of the target's reference rectangle in its own frame [m]."""
    site = model.site(OUTLINE)
    a, b, _ = site.size
    return site.pos + np.array([[-a, b, 0], [a, b, 0], [a, -b, 0], [-a, -b, 0]])


def exposure_steps(camera: CameraConfig, steps: int) -> frozenset[int]:
    """The physics steps of a frame interval at which a sub-frame is taken, besides the one at its
    end.
    """
    if camera.exposure == 0:
        return frozenset()
    before_end = np.linspace(0, camera.exposure * steps, camera.subframes)[1:]
    return frozenset(int(k) for k in np.clip(np.rint(steps - before_end), 0, steps - 1))
