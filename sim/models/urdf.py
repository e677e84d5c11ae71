"""URDF made ready for MuJoCo: with shapes that it draws, meshes that it finds, sound inertias."""

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from sim.models.model_assets import MESHES, PACKAGE, Assets

URDF_COMPILER = {
    "discardvisual": "false",
    "fusestatic": "false",
    "strippath": "false",
    "balanceinertia": "true",
    "boundmass": "0.001",
    "boundinertia": "1e-6",
}
"""All links stay, as the camera may be at any of them; poor masses and inertias are mended."""
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def complete_urdf(tree: Element, assets: Assets, folder: Path) -> None:
    """Prepare a URDF for MuJoCo: meshes get absolute paths, and what it cannot read is left out.

    Raises:
        ValueError: A mesh cannot be had, or the file has to be expanded first.
    """
    if any(element.tag.startswith("{") for element in tree.iter()):
        raise ValueError(
            "it has elements of a namespace; expand xacro files first (xacro IN > OUT)"
        )
    extension = tree.find("mujoco/compiler")
    own = folder / (extension.get("meshdir", "") if extension is not None else "")
    for child in [c for c in tree if c.tag not in ("link", "joint", "material")]:
        tree.remove(child)
    for material in tree.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
    for link in tree.findall("link"):
        _keep_visible(link)
        _leave_out_wrong_inertia(link)
    for mesh in tree.iter("mesh"):
        name = mesh.get("filename", "").removeprefix("file://")
        rest = PACKAGE.sub("", name)
        places = (assets.root,) if rest != name else (folder, own)
        path = assets.find(rest, *places)
        assets.add_mesh(path)
        mesh.set("filename", str(path))
    extension = ElementTree.SubElement(tree, "mujoco")
    ElementTree.SubElement(extension, "compiler", URDF_COMPILER)


def _keep_visible(link: Element) -> None:
    shapes = {tag: link.findall(tag) for tag in ("visual", "collision")}
    readable = [v for v in shapes["visual"] if _is_readable(v)]
    for shape in [*shapes["visual"], *(shapes["collision"] if readable else [])]:
        if shape not in readable:
            link.remove(shape)


def _is_readable(shape: Element) -> bool:
    mesh = shape.find("geometry/mesh")
    return mesh is None or mesh.get("filename", "").lower().endswith(MESHES)


def _leave_out_wrong_inertia(link: Element) -> None:
    """Zeros stand for an unknown inertia: the link then has that of its shapes, or the least."""
    inertial = link.find("inertial")
    given = None if inertial is None else inertial.find("inertia")
    if inertial is None or given is None:
        return
    xx, xy, xz, yy, yz, zz = (float(given.get(key, "0")) for key in INERTIA)
    if np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0] <= 0:
        link.remove(inertial)


def speeds(tree: Element) -> dict[str, float]:
    """The largest rates of a URDF's joints by name [rad/s or m/s], which MuJoCo does not read."""
    limits = {joint.get("name", ""): joint.find("limit") for joint in tree.findall("joint")}
    given = {
        name: float(limit.get("velocity", "0"))
        for name, limit in limits.items()
        if limit is not None
    }
    return {name: speed for name, speed in given.items() if 0 < speed < math.inf}
