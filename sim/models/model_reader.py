"""Reading of robot and target models, MJCF or URDF, with MuJoCo. Names like package://, Collada
meshes and damaged meshes, which MuJoCo does not read, are replaced first.
"""

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from sim.files import reading
from sim.files.notices import notice
from sim.files.packages import folders_above, is_file, package_folder, parted
from sim.models.mending import Mended, draw_sticks, geoms_of, mend
from sim.models.mesh_file import OBJ, is_readable, read_mesh, why_not
from sim.models.model_files import compiled, keep_no_log, said_by_mujoco
from sim.models.shapes import fill, show

READABLE = (".stl", OBJ, ".msh")
"""Suffixes of meshes that MuJoCo reads."""
SLOWEST = 0.001
FASTEST = 1000.0
"""Rates that a URDF gives in earnest [rad/s or m/s]: exporters write 0, 1e10 or infinity too."""
GREY = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's colour of a geom that is given none."""
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

WEIGHTS = {"mass": ["value"], "inertia": ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]}
"""The numbers of a link's `inertial` element, all of which MuJoCo wants."""


def read_spec(path: Path, what: str, *, whole: bool = True) -> mujoco.MjSpec:
    """Return the MuJoCo specification of a robot or target from an MJCF or URDF file; it compiles.
    Masses and inertias that MuJoCo refuses are corrected, and shapes of a URDF file in a format
    that cannot be read are left out, with a warning.

    Args:
        path: The model's file.
        what: The kind of model in messages, such as "robot".
        whole: True: raise an error if MuJoCo refuses a shape, or misses a texture's file; False:
            leave it out and warn.

    Raises:
        ValueError: The file cannot be read or compiled; the message begins with its path.
    """
    reading.opened(path, what).close()
    keep_no_log()
    try:
        urdf = path.suffix.lower() == ".urdf"
        mended = Mended()
        spec = spec_of_urdf(path, mended) if urdf else mujoco.MjSpec.from_file(str(path.resolve()))
        try:
            model = compiled(spec.copy())
            if not np.isfinite(np.hstack([model.body_mass, *model.body_inertia])).all():
                raise ValueError("the mass or the inertia of a body is not finite: correct it")
        except ValueError:
            model = mend(spec, path, mended, whole=whole)
        if mended.lost and not spec.geoms:
            draw_sticks(spec)
        if not np.isfinite(np.hstack([model.body_pos, model.body_ipos])).all():
            raise ValueError("the position of a body is not finite: correct it")
    except (ValueError, RecursionError, ElementTree.ParseError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: cannot read this {what}: {said_by_mujoco(error)}") from None
    if str(mended):
        notice(f"{path}: {mended}")
    return spec


def spec_of_urdf(path: Path, mended: Mended) -> mujoco.MjSpec:
    """Return the MuJoCo specification of the model in a URDF file, with absolute paths of meshes.

    Links show their visual shapes, or their collision shapes if no visual one can be read. The
    record `mended` gets the meshes, materials and textures that cannot be shown, and the names of
    links whose mass or inertia lacks numbers, which become 0.

    Raises:
        ParseError: The file is not XML.
        ValueError: The file has xacro elements, a joint's limits are not numbers or its lower limit
            is above its upper one, or MuJoCo cannot read the file.
    """
    tree = ElementTree.parse(path).getroot()
    _leave_out_namespaces(tree)
    for joint in tree.iter("joint"):
        _check_limit(joint)
    given = tree.find("mujoco/compiler")
    folder = path.parent / ("" if given is None else given.get("meshdir", ""))
    for mesh in tree.iter("mesh"):
        mesh.set("filename", str(_mesh_file(mesh.get("filename", ""), path, folder)))
    for link in tree.iter("link"):
        _complete_weights(link, mended)
        _keep_visible(link, mended)
    for extension in tree.findall("mujoco"):
        tree.remove(extension)
    extension = ElementTree.SubElement(tree, "mujoco")
    ElementTree.SubElement(extension, "compiler", COMPILER)
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(tree, "unicode"))
    for shape in list(spec.meshes):
        _show_materials(spec, shape, mended)
    return spec


def _leave_out_namespaces(tree: Element) -> None:
    """Delete the elements of a URDF file that belong to other programs, such as a simulator's
    sensors, by their XML namespace; refuse those of xacro.

    Raises:
        ValueError: The file has xacro elements.
    """
    for parent in list(tree.iter()):
        for element in list(parent):
            if "xacro}" in element.tag:
                raise ValueError("the file has xacro elements: expand it first (xacro IN > OUT)")
            if element.tag.startswith("{"):
                parent.remove(element)


def _complete_weights(link: Element, mended: Mended) -> None:
    """Set the numbers of a mass and an inertia that are not given, which MuJoCo wants, to 0."""
    for name, keys in WEIGHTS.items():
        for element in link.findall(f"inertial/{name}"):
            missing = [key for key in keys if key not in element.attrib]
            element.attrib.update(dict.fromkeys(missing, "0"))
            if missing:
                mended.corrected.append(link.get("name", ""))


def _check_limit(joint: Element) -> None:
    """Check that a URDF joint's lower limit is not above its upper one; MuJoCo would ignore such a
    range.

    Raises:
        ValueError: The lower limit is above the upper one, or a limit is not a number.
    """
    limit = joint.find("limit")
    if limit is None:
        return
    lower, upper = (_number(joint, limit, key) for key in ("lower", "upper"))
    if lower > upper:
        raise ValueError(
            f"the lower limit {lower:g} of the joint '{joint.get('name', '')}' is above its upper "
            f"limit {upper:g}: correct them"
        )


def _number(joint: Element, limit: Element, key: str) -> float:
    """Return a number of a joint's limits in a URDF file; 0 if the file does not give it.

    Raises:
        ValueError: The file gives no number.
    """
    given = limit.get(key, "0")
    try:
        return float(given)
    except ValueError:
        raise ValueError(
            f"the joint '{joint.get('name', '')}' has {key} = '{given}': expected a number"
        ) from None


def joint_speeds(path: Path) -> dict[str, float]:
    """Return the largest rates [rad/s or m/s] of the joints in a URDF file by name, which MuJoCo
    does not read; rates outside 0.001 to 1000 are left out. Return {} for an MJCF file.

    Raises:
        ValueError: A joint's largest rate is not a number.
    """
    if path.suffix.lower() != ".urdf":
        return {}
    found: dict[str, float] = {}
    for joint in ElementTree.parse(path).iter("joint"):
        limit = joint.find("limit")
        speed = 0.0 if limit is None else _number(joint, limit, "velocity")
        if SLOWEST <= speed <= FASTEST:
            found[joint.get("name", "")] = speed
    return found


def _mesh_file(name: str, model: Path, folder: Path) -> Path:
    """Return the path of a mesh file that a URDF file names: below the folder for meshes; else in
    the ROS package that the name gives, which is beside or around the model; else, by the path
    inside this package, below the folder for meshes or a folder around the model. Without such a
    file it is a path below the folder for meshes.

    Args:
        name: Name of the mesh in the URDF file, such as "package://arm/link.stl".
        model: The URDF file.
        folder: The folder for meshes.
    """
    if is_file(folder / name):
        return (folder / name).resolve()
    package, inside = parted(name)
    own = package_folder(model, package, inside) if package else None
    if own:
        return (own / inside).resolve()
    places = [place for place in (folder, *folders_above(model)) if is_file(place / inside)]
    if package and places:
        notice(
            f"{model}: there is no package '{package}' around it; its files are taken from "
            f"{places[0].resolve()}"
        )
    return ((places or [folder])[0] / inside).resolve()


def _keep_visible(link: Element, mended: Mended) -> None:
    """Keep the visual shapes of a link that can be read, else those for collisions."""
    visuals = link.findall("visual")
    collisions = link.findall("collision")
    kept = [shape for shape in visuals if _is_readable(shape)]
    kept = kept or [shape for shape in collisions if _is_readable(shape)]
    for shape in kept:
        shape.attrib.pop("name", None)  # MuJoCo complains of names that are there twice
    for shape in [shape for shape in (*visuals, *collisions) if shape not in kept]:
        link.remove(shape)
        mesh = shape.find("geometry/mesh")
        if mesh is not None and (shape in visuals or not kept):
            file = Path(mesh.get("filename", ""))
            mended.lost.append((file.name, why_not(file)))


def _is_readable(shape: Element) -> bool:
    mesh = shape.find("geometry/mesh")
    file = Path("" if mesh is None else mesh.get("filename", ""))
    return mesh is None or file.suffix.lower() in READABLE or is_readable(file)


def _show_materials(spec: mujoco.MjSpec, shape: mujoco.MjsMesh, mended: Mended) -> None:
    """Show a mesh with its own materials, which MuJoCo ignores, unless the model gives a colour."""
    file = Path(shape.file)
    suffix = file.suffix.lower()
    is_painted = suffix == OBJ and file.is_file() and b"mtllib" in file.read_bytes()
    if suffix in READABLE and not is_painted:
        return
    try:
        mesh = read_mesh(file, (suffix,))
    except ValueError:
        return  # it is left out where the model does not compile
    geoms = geoms_of(spec, shape)
    if any(geom.material or not np.array_equal(geom.rgba, GREY) for geom in geoms):
        fill(shape, mesh, None)
        return
    mended.lost.extend(mesh.missing)
    show(spec, shape, geoms, mesh.parts())
