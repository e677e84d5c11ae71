"""Target from a model file of the user, MJCF or URDF: its geoms as they are, moving as one."""

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.files.shipped import file_of
from sim.models.model_files import SIMULATION, leave_out, said_by_mujoco
from sim.models.model_reader import read_spec
from sim.models.paint import Outlined
from sim.models.target import Target
from sim.ranges import File

MOVING = (*SIMULATION, "actuators", "joints", "cameras")
"""Parts of a model that a target does not have."""


@dataclass(frozen=True, slots=True)
class Config(Outlined):
    """Settings of a target from a model file: the model and, if wanted, length, width and height
    over the table of its reference rectangle [m].
    """

    model: File = "truck"
    """A shipped model's name, or an .xml or .urdf file: x is its nose, z is up, and the table is at
    z = 0. Joints, actuators, sensors, cameras, lights and the sky are left out."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: the model in the file, without joints, and the reference rectangle
        that stands for it in control. `rng` is not used.

        Raises:
            ValueError: The file cannot be read or is damaged, has a plane, has a site `outline`
                that is not aligned with the model's axes, or has nothing that is seen from above.
        """
        path = file_of(self.model, "targets", ".xml", "model")
        spec = read_spec(path, "target")
        leave_out(spec, MOVING)
        for body in spec.bodies:
            body.mocap = False
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
            if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                named = f"'{geom.name}'" if geom.name else f"of the body '{geom.parent.name}'"
                raise ValueError(
                    f"{path}: the geom {named} is a plane, which cannot move: delete it"
                )
        try:
            target = self.target(spec)
        except ValueError as error:
            raise ValueError(f"{path}: {said_by_mujoco(error)}") from None
        for site in spec.sites:
            spec.delete(site)  # they are drawn otherwise
        return target
