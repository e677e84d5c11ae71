"""A model of the user's in MuJoCo's format: its geoms as they are, moving as one."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.model_files import read_spec
from sim.target import Target
from sim.targets._settings import Outlined, file_of

MOVING = (
    "keys", "sensors", "actuators", "tendons", "equalities", "excludes", "pairs", "joints",
    "cameras", "lights",
)  # fmt: skip
"""What a target does not have, in an order in which nothing refers to what is gone."""
UNBOUNDED = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_HFIELD: "height field",
}


@dataclass(frozen=True, slots=True)
class Config(Outlined):
    """Which model."""

    model: str = "truck"
    """A shipped model's name, or an .xml file; x is its nose, z is up, and the table is at z = 0.
    Joints, actuators, sensors, cameras and lights are left out."""

    def build(self, rng: np.random.Generator) -> Target:
        """The target; draws nothing.

        Raises:
            ValueError: The file cannot be read or is broken, or has a plane or a height field.
        """
        path = file_of(self.model, ".xml", "target.model")
        spec = read_spec(path, "target")
        for part in MOVING:
            for element in list(getattr(spec, part)):
                spec.delete(element)
        for body in spec.bodies:
            body.mocap = False
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
            if geom.type in UNBOUNDED:
                what = f"the geom '{geom.name}' is a {UNBOUNDED[geom.type]}"
                raise ValueError(f"{path}: {what}, which cannot move: remove it")
        try:
            return self.target(spec)
        except ValueError as error:
            raise ValueError(f"{path}: {str(error).splitlines()[0]}") from None
