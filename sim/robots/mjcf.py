"""Robot from a model file, MJCF or URDF, that carries the camera (or the target) at its flange."""

import functools
import importlib
import os
from dataclasses import dataclass, replace
from importlib import resources
from math import radians
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from annotated_types import Ge, Le, MinLen

from sim.files.shipped import file_of
from sim.geometry import mount_pose
from sim.kinematics.model import camera_chain, drive, make_robot
from sim.kinematics.robot import Design, Drives, Inversion, each_joint
from sim.models.model_reader import joint_speeds, read_spec
from sim.ranges import Degrees, File, Place
from sim.types import Pose

Home = Annotated[tuple[Annotated[float, Ge(-1000), Le(1000)], ...], MinLen(1)]
Rate = Annotated[float, Ge(0.001), Le(100)]
WHAT = "robot model"
AT_LIMIT = 0.01
"""A home may be this far outside of a joint's limits, which may be rounded [rad or m]."""
FOLDER = "robots"
"""Folder of the shipped models in `scenes`."""
MENAGERIE = "menagerie:"
ROOT = "MENAGERIE_ROOT"
CHECKOUT = (
    f"set {ROOT} to the folder of a checkout of github.com/google-deepmind/mujoco_menagerie and "
    f"name the file, as in {MENAGERIE}universal_robots_ur5e/ur5e.xml"
)
"""End of a message: how to use robots without a download."""


ELSEWHERE = ", or try another robot.base, or a robot.home near a posture that gets there"


@dataclass(frozen=True, slots=True)
class Config(Drives):
    """Settings of a robot from a model file (`model`): its base in the room (x, y, z [m], yaw
    [deg]); the camera's pose on the flange (`mount`: x, y, z [m], roll, pitch, yaw [deg]), or else
    a camera of the model; start postures (`home`) [m or rad], largest joint rates [m/s or rad/s],
    and the errors of drives and encoders.
    """

    model: File = "arm7"
    """Its file, MJCF or URDF: a path from the scenario's folder or from the working directory, a
    shipped one's name, menagerie:NAME of the package mujoco-menagerie, or menagerie:PATH below the
    folder that MENAGERIE_ROOT names."""
    base: tuple[Place, Place, Place, Degrees] = (0.0, 0.5, 0.6, -90.0)
    """Pose of the robot's base in the room: x, y, z [m], and its turn about z [deg]; by default
    behind the table's middle, 0.6 m above it, its x towards the middle.
    """
    flange: str = ""
    """The body or site that carries the camera; by default the end of the longest chain of joints
    (its only site, if it has one), or where that branches into fingers."""
    mount: tuple[Place, Place, Place, Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Pose of the camera on the flange: x, y, z [m], roll, pitch, yaw [deg] about fixed axes as in
    URDF; with zeros it is in the flange's origin and looks along its z, with x to the right.
    """
    camera: str = ""
    """Name of a camera of the model, in place of flange and mount."""
    home: tuple[Home, ...] = ()
    """Joint positions [rad or m] at which the search for a start pose begins, one posture after
    another; by default it begins at random positions."""
    speed: tuple[Rate, ...] = ()
    """Largest rate of each joint, or one for all [rad/s or m/s]; by default the model's."""

    def build(self, rng: np.random.Generator) -> Design:
        """Read the model file, and return the design of the robot (model, drives, home positions
        and base) with these settings; `rng` is not used.

        Raises:
            ValueError: The model file is missing or damaged, or a setting does not fit the model;
                the message says which.
        """
        path = model_path(self.model)
        spec = read_spec(path, WHAT, whole=False)
        try:
            self._prepare(spec, joint_speeds(path))
        except ValueError as error:
            raise ValueError(f"{path.name}: {error}") from None
        x, y, z, yaw = self.base
        base = Pose(Pose.planar(0.0, 0.0, radians(yaw)).rotation, np.array([x, y, z]))
        return Design(path.name, spec, drives=self, homes=self.home, base=base, advice=ELSEWHERE)

    def _prepare(self, spec: mujoco.MjSpec, own: dict[str, float]) -> None:
        """Turn a model into a robot, with the camera, the drives and the start postures of these
        settings.

        Args:
            spec: The model, which is changed.
            own: Largest rates of joints by name, from a URDF file [m/s or rad/s].

        Raises:
            ValueError: A setting does not fit the model.
        """
        if self.camera and (self.flange or any(self.mount)):
            raise ValueError(
                "camera is given together with flange or mount: give either camera, or flange "
                "and mount"
            )
        model, chain = camera_chain(spec, self.flange, self.camera)
        names = make_robot(spec, model, chain, self.camera, mount_pose(self.mount))
        drive(spec, model, chain.joints, self._speeds(names, own))
        for home in self.home:
            if len(home) != len(names):
                raise ValueError(
                    f"home has {len(home)} joint positions; it should have {len(names)}, for "
                    f"{', '.join(names)}"
                )
            for name, joint, at in zip(names, chain.joints, home, strict=True):
                low, high = model.jnt_range[joint]
                if model.jnt_limited[joint] and not low - AT_LIMIT <= at <= high + AT_LIMIT:
                    limits = f"{low:.3g} .. {high:.3g}"
                    raise ValueError(
                        f"home has the joint {name} at {at:g}, outside of its limits {limits}: "
                        "correct home"
                    )

    def _speeds(self, names: tuple[str, ...], own: dict[str, float]) -> list[float | None]:
        if self.speed:
            return each_joint("speed", self.speed, names).tolist()
        return [own.get(name) for name in names]


def model_path(model: str) -> Path:
    """Return the path of the robot model file that the setting `robot.model` names: a path (which
    need not exist), a shipped model's name, or "menagerie:NAME" or "menagerie:NAME/FILE" of the
    package mujoco-menagerie, which downloads a robot at its first use.

    If the environment variable MENAGERIE_ROOT names a folder, a name with a suffix, such as
    "menagerie:NAME/FILE.xml", is a file in this folder, which need not exist.

    Raises:
        ValueError: There is no shipped model of this bare name; or the Menagerie is not installed,
            has no such robot, or cannot download the robot.
    """
    if model.startswith(MENAGERIE):
        return _in_menagerie(model)
    return file_of(model, FOLDER, ".xml", "model")


def _in_menagerie(model: str) -> Path:
    """Return the model file that a name with "menagerie:" stands for: a file in the folder
    MENAGERIE_ROOT if that is set and the name has a suffix, else that of the package
    mujoco-menagerie, which downloads a robot at its first use.

    Raises:
        ValueError: The package is not installed, has no such robot, or cannot download the robot.
    """
    path = Path(model.removeprefix(MENAGERIE))
    folder = os.environ.get(ROOT)
    if folder and path.suffix:
        return Path(folder) / path
    try:
        package = importlib.import_module("mujoco_menagerie")
    except ModuleNotFoundError:
        raise ValueError(
            f"{model}: the package mujoco-menagerie is not installed: pip install "
            f"mujoco-menagerie, or {CHECKOUT}"
        ) from None
    try:
        robot = package.get(path.parts[0] if path.parts else "")
        file = path.stem if path.suffix else robot.default_model
        return Path(robot.xml(file))
    except (package.DownloadError, OSError) as error:
        raise ValueError(
            f"{model}: this robot cannot be downloaded: {error}; without a network, {CHECKOUT}"
        ) from None
    except package.MenagerieError as error:
        raise ValueError(f"{model}: {error}") from None


@functools.cache  # reading it takes 2 ms, and it is the same in all runs of a study
def shipped(
    model: str, drives: Drives, homes: tuple[tuple[float, ...], ...], inversion: Inversion
) -> Design:
    """Return the design (model and settings) of a robot that comes with servobench; a second call
    with the same arguments returns the same object.

    Args:
        model: File of its model in `scenes/robots`, such as "arm.xml".
        drives: Errors of its drives and encoders.
        homes: Joint positions [m or rad] at which the search for a start pose begins.
        inversion: Settings of its inverse kinematics.
    """
    path = str(resources.files("scenes") / FOLDER / model)
    config = Config(model=path, base=(0.0, 0.0, 0.0, 0.0), camera="eye", home=homes)
    design = config.build(np.random.default_rng(0))  # uses no random numbers
    return replace(design, drives=drives, inversion=inversion, advice="")
