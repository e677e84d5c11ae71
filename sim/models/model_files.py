"""Models of robots and targets in files, MJCF or URDF, read by MuJoCo, which reads neither
package:// nor Collada: URDF files are made ready for it.
"""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from sim.files import reading

SIMULATION = (
    "keys",
    "sensors",
    "tendons",
    "equalities",
    "excludes",
    "pairs",
    "lights",
)
"""Parts of a model that describe a whole simulation, in an order in which none refers to one that
is gone."""
READABLE = (".stl", ".obj", ".msh")
"""Suffixes of meshes that MuJoCo reads."""
PLACE = re.compile("^(file://|(package|model)://[^/]*/+)")
"""How URDF begins the name of a mesh, other than with its path."""
SLOWEST = 0.001
FASTEST = 1000.0
"""Rates that a URDF gives in earnest [rad/s or m/s]: exporters write 0, 1e10 or infinity too."""
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


def read_spec(path: Path, what: str) -> mujoco.MjSpec:
    """Return the model in an MJCF or URDF file, which compiles as it is.

    Args:
        path: Its file.
        what: The kind of model, for messages: "robot".

    Raises:
        ValueError: It cannot be read or compiled; the sentence begins with the file's name.
    """
    reading.opened(path, what).close()
    _keep_no_log()
    try:
        urdf = path.suffix.lower() == ".urdf"
        spec = spec_of_urdf(path) if urdf else mujoco.MjSpec.from_file(str(path.resolve()))
        model = compiled(spec.copy())
        if not np.isfinite(np.hstack([model.body_pos, model.body_ipos, model.body_inertia])).all():
            raise ValueError("the place or the inertia of a body is not finite")
    except (ValueError, RecursionError, ElementTree.ParseError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: cannot read this {what}: {said_by_mujoco(error)}") from None
    return spec


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a model; what MuJoCo only warns of is left alone.

    It warns where the options of an attached model differ from those of the room, which hold.
    """
    _keep_no_log()
    with warnings.catch_warnings(action="ignore"):
        return spec.compile()


def said_by_mujoco(error: Exception) -> str:
    """Return a message of MuJoCo's compiler as part of a sentence."""
    lines = (line for line in str(error).splitlines() if line)
    return ", ".join(lines).removeprefix("XML Error: ").removeprefix("Error: ")


def leave_out(spec: mujoco.MjSpec, parts: Iterable[str]) -> None:
    """Delete lists of a model's elements, such as "sensors", and its sky."""
    skies = [t for t in spec.textures if t.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    for element in [*(element for part in parts for element in getattr(spec, part)), *skies]:
        spec.delete(element)


def _keep_no_log() -> None:
    """Stop MuJoCo from writing MUJOCO_LOG.TXT into the working directory, and to the terminal."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()


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
    for joint in tree.iter("joint"):
        _check_limit(joint)
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


def _check_limit(joint: Element) -> None:
    """Refuse a range that ends before it begins, which MuJoCo takes for none at all."""
    limit = joint.find("limit")
    if limit is None:
        return
    lower, upper = (float(limit.get(key, "0")) for key in ("lower", "upper"))
    if lower > upper:
        raise ValueError(
            f"joint '{joint.get('name', '')}': its lower limit {lower:g} is above its upper "
            f"limit {upper:g}"
        )


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
        if SLOWEST <= speed <= FASTEST:
            found[joint.get("name", "")] = speed
    return found


def _mesh_file(name: str, model: Path, folder: Path) -> Path:
    """Find a mesh: beside the model, in a folder around it such as its ROS package, or in the
    folder for meshes.
    """
    places = (*model.resolve().parents, folder)
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
