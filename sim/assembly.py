"""The scene put together: a robot in its room, the target, props, compiled for a camera."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from collections.abc import Iterable
from importlib import resources

import mujoco
import numpy as np

from sim.camera import FOVY, CameraConfig
from sim.robot import EYE, Design
from sim.types import Array

OUTLINE = "target/outline"
TARGET, OTHER = "target/car", "other/car"
PROPS = {"car": "other/"}
"""MJCF models in scenes/ that a disturbance may need, by the prefix of their names in the scene."""
SPOT = "spot"
"""The prop of a light that is not the same everywhere: MuJoCo lights corners and blends between
them, so the table needs more of them."""
FINE_QUADS = 8


def build_model(
    physics_rate: float, camera: CameraConfig, robot: Design, props: Iterable[str] = ()
) -> mujoco.MjModel:
    """The robot's scene with the car in it, compiled for a camera."""
    scenes = resources.files("scenes")
    with resources.as_file(scenes) as folder:
        spec = mujoco.MjSpec.from_file(str(folder / robot.model))
        wanted = set(props)
        models = [("car", "target/"), *((p, PROPS[p]) for p in sorted(wanted & set(PROPS)))]
        for name, prefix in models:
            model = mujoco.MjSpec.from_file(str(folder / f"{name}.xml"))
            spec.attach(model, prefix=prefix, frame=spec.worldbody.add_frame())
        if SPOT in wanted:
            spec.visual.quality.numquads = FINE_QUADS
        spec.option.timestep = 1.0 / physics_rate
        spec.camera(EYE).fovy = camera.fovy_deg or FOVY
        return spec.compile()


def outline_of(model: mujoco.MjModel) -> Array:
    """Corners (4, 3) of the target's reference rectangle in its own frame [m]."""
    site = model.site(OUTLINE)
    a, b, _ = site.size
    return site.pos + np.array([[-a, b, 0], [a, b, 0], [a, -b, 0], [-a, -b, 0]])
