"""Robots written for tests: a URDF of six joints and cylinders, an MJCF of seven with meshes."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from sim.camera.camera import CameraConfig
from sim.kinematics.robot import Inversion, Robot
from sim.models.assembly import build_model
from sim.robots import mjcf
from sim.targets import car

UR_LIKE = [  # joint, parent, axis, origin xyz of the child link
    ("pan", "base", "0 0 1", "0 0 0.09"),
    ("lift", "pan", "0 1 0", "0 0.13 0"),
    ("elbow", "lift", "0 1 0", "0 -0.12 0.42"),
    ("wrist_1", "elbow", "0 1 0", "0 0 0.39"),
    ("wrist_2", "wrist_1", "0 0 1", "0 0.09 0"),
    ("wrist_3", "wrist_2", "0 1 0", "0 0 0.09"),
]
"""Lengths of the links as those of a UR5."""
PANDA_LIKE = [  # pos, quat, range
    ("0 0 .333", "1 0 0 0", "-2.9 2.9"),
    ("0 0 0", "1 -1 0 0", "-1.76 1.76"),
    ("0 -.316 0", "1 1 0 0", "-2.9 2.9"),
    ("0.0825 0 0", "1 1 0 0", "-3.07 -0.07"),
    ("-0.0825 .384 0", "1 -1 0 0", "-2.9 2.9"),
    ("0 0 0", "1 1 0 0", "-0.02 3.75"),
    ("0.088 0 0", "1 1 0 0", "-2.9 2.9"),
]
"""Axes and lengths of a Panda."""
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.03
FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def urdf_arm(effort: float = 150.0) -> str:
    """Six joints, a flange `tool` that looks along the last link's y, and a finger."""
    parts = ['<robot name="ur_like"><link name="base"/>']
    for name, parent, axis, xyz in UR_LIKE:
        below = "base" if parent == "base" else f"{parent}_link"
        parts.append(
            f'<link name="{name}_link"><inertial><mass value="2"/><origin xyz="0 0 0.1"/>'
            '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
            '<visual><origin xyz="0 0 0.03"/><geometry><cylinder radius="0.03" length="0.06"/>'
            "</geometry></visual></link>"
            f'<joint name="{name}" type="revolute"><parent link="{below}"/>'
            f'<child link="{name}_link"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            f'<limit lower="-6.28" upper="6.28" effort="{effort}" velocity="3.15"/></joint>'
        )
    parts.append(
        '<link name="tool"/><joint name="fixed" type="fixed"><parent link="wrist_3_link"/>'
        '<child link="tool"/><origin xyz="0 0.09 0" rpy="-1.5707963 0 0"/></joint></robot>'
    )
    return "\n".join(parts)


def tall_arm() -> str:
    """Six joints of 0.4 m arms on a base, whose limits are in the way of most searches."""
    offsets = 0.2, 0.1, 0.4, 0.4, 0.08, 0.08
    axes = "0 0 1", "0 1 0", "0 1 0", "0 1 0", "1 0 0", "0 0 1"
    limits = 2.9, 2.2, 2.8, 2.8, 2.8, 3.1
    body = '<site name="tool"/>'
    for k, (offset, axis, limit) in reversed([*enumerate(zip(offsets, axes, limits, strict=True))]):
        body = (
            f'<body name="link{k + 1}" pos="0 0 {offset}"><joint name="j{k + 1}" axis="{axis}" '
            f'range="-{limit} {limit}"/><geom type="sphere" size="0.03" mass="1"/>{body}</body>'
        )
    compiler = '<compiler angle="radian" autolimits="true"/>'
    return f"<mujoco>{compiler}<worldbody>{body}</worldbody></mujoco>"


def mjcf_arm(folder: Path) -> str:
    """Seven joints with position actuators, a mesh on each link, and a gripper of two fingers."""
    write_stl(folder / "link.stl")
    write_obj(folder / "link.obj")
    body, end = "", ""
    for i, (pos, quat, limits) in enumerate(PANDA_LIKE, 1):
        mesh = "solid" if i % 2 else "wavefront"
        body += (
            f'<body name="link{i}" pos="{pos}" quat="{quat}">'
            f'<joint name="joint{i}" range="{limits}"/>'
            f'<geom type="mesh" mesh="{mesh}" mass="2"/>'
        )
        end += "</body>"
    fingers = "".join(
        f'<body name="{side}" pos="{x} 0 .05"><joint name="{side}" type="slide" axis="1 0 0" '
        'range="0 .04"/><geom size=".005" mass=".01"/></body>'
        for side, x in (("left", 0.04), ("right", -0.04))
    )
    site = '<site name="attachment" pos="0 0 .107"/>'
    motors = "".join(
        f'<position name="a{i}" joint="joint{i}" kp="2000" kv="200" forcerange="-87 87"/>'
        for i in range(1, 8)
    )
    return f"""<mujoco model="panda_like">
  <compiler angle="radian" meshdir="." autolimits="true"/>
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <default><joint axis="0 0 1" damping="1" armature=".1" frictionloss=".2"/></default>
  <asset><mesh name="solid" file="link.stl"/><mesh name="wavefront" file="link.obj"/>
    <texture name="sky" type="skybox" builtin="flat" width="8" height="8"/></asset>
  <worldbody><light pos="0 0 3"/><geom name="floor" type="plane" size="0 0 .05"/>
    {body}{site}{fingers}{end}
  </worldbody>
  <tendon><fixed name="grip"><joint joint="left" coef=".5"/><joint joint="right" coef=".5"/></fixed>
  </tendon>
  <equality><joint joint1="left" joint2="right"/></equality>
  <actuator>{motors}<general name="grip" tendon="grip" ctrlrange="0 1"/></actuator>
  <keyframe><key name="home" qpos="0 0 0 -1.57 0 1.57 .78 .04 .04"/></keyframe>
</mujoco>"""


def write_stl(path: Path) -> None:
    """A cube as binary STL."""
    faces = [struct.pack("<12fH", 0, 0, 0, *CUBE[list(face)].ravel(), 0) for face in FACES]
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(faces)) + b"".join(faces))


def write_obj(path: Path) -> None:
    """A cube as OBJ."""
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE]
    path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]) + "\n")


def built(
    inversion: Inversion | None = None, **settings: Any
) -> tuple[Robot, mujoco.MjModel, mujoco.MjData]:
    """The robot of these settings of `mjcf` in the room."""
    rng = np.random.default_rng(0)
    design = mjcf.Config(**settings).build(rng)
    if inversion is not None:
        design = replace(design, inversion=inversion)
    model = build_model(480.0, CameraConfig(), design, car.Config().build(rng))
    return Robot(model, design), model, mujoco.MjData(model)
