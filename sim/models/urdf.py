"""URDF files made ready for MuJoCo, which reads neither package:// nor Collada."""

import math
import re
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco

READABLE = (".stl", ".obj", ".msh")
"""Suffixes of meshes that MuJoCo reads."""
PLACE = re.compile("^(file://|(package|model)://[^/]*/+)")
"""How URDF begins the name of a mesh, other than with its path."""
COMPILER = {
    "discardvisual": "false",
    "fusestatic": "false",
    "strippath": "false",
    "balanceinertia": "true",
    "boundmass": "0.001",
    "boundinertia": "1e-6",
}
"""Every link stays, as the camera may be at any of them. Many exporters write zeros for an unknown
mass or inertia, which MuJoCo refuses: the least ones take their place."""


def spec_of_urdf(path: Path) -> mujoco.MjSpec:
    """Return the model in a URDF file, with absolute paths of meshes.

    Links show their visual shapes, or those for collisions where MuJoCo reads no visual one.

    Raises:
        ParseError: It is not XML.
        ValueError: It is not expanded xacro, or MuJoCo cannot read it.
    """
    tree = ElementTree.parse(path).getroot()
    if any(element.tag.startswith("{") for element in tree.iter()):
        raise ValueError(
            "it has elements of a namespace; expand xacro files first (xacro IN > OUT)"
        )
    given = tree.find("mujoco/compiler")
    folder = path.parent / ("" if given is None else given.get("meshdir", ""))
    for link in tree.iter("link"):
        _keep_visible(link)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", str(_mesh_file(mesh.get("filename", ""), path, folder)))
    for extension in tree.findall("mujoco"):
        tree.remove(extension)
    extension = ElementTree.SubElement(tree, "mujoco")
    ElementTree.SubElement(extension, "compiler", COMPILER)
    return mujoco.MjSpec.from_string(ElementTree.tostring(tree, "unicode"))


def joint_speeds(path: Path) -> dict[str, float]:
    """Return the largest rates of a URDF's joints by name [rad/s or m/s], which MuJoCo skips; of
    an MJCF file none.
    """
    if path.suffix.lower() != ".urdf":
        return {}
    found: dict[str, float] = {}
    for joint in ElementTree.parse(path).iter("joint"):
        limit = joint.find("limit")
        speed = 0.0 if limit is None else float(limit.get("velocity", "0"))
        if 0 < speed < math.inf:
            found[joint.get("name", "")] = speed
    return found


def package_folder(model: Path) -> Path:
    """Return the ROS package around a URDF: the nearest folder with a package.xml, or its own."""
    own = model.resolve().parent
    return next((f for f in (own, *own.parents) if (f / "package.xml").is_file()), own)


def _mesh_file(name: str, model: Path, folder: Path) -> Path:
    """Find a mesh: in the package, beside the model, or in the folder for meshes."""
    places = (package_folder(model), model.parent, folder)
    files = [(place / PLACE.sub("", name)).resolve() for place in places]
    return next((file for file in files if file.is_file()), files[-1])


def _keep_visible(link: Element) -> None:
    visuals = [shape for shape in link.findall("visual") if _is_readable(shape)]
    kept = visuals or link.findall("collision")
    for shape in [*link.findall("visual"), *link.findall("collision")]:
        if shape not in kept:
            link.remove(shape)


def _is_readable(shape: Element) -> bool:
    mesh = shape.find("geometry/mesh")
    return mesh is None or mesh.get("filename", "").lower().endswith(READABLE)
