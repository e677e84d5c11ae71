"""Repair of models that MuJoCo refuses because of their meshes, textures, masses or inertias."""

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from sim.files.behind import files_behind
from sim.models.mesh_file import Lost, first_of, listed, read_mesh, why_not
from sim.models.model_files import compiled
from sim.models.shapes import fill

SIZES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: 1,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 1,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 1,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: 3,
    mujoco.mjtGeom.mjGEOM_BOX: 3,
}
"""Numbers of sizes that may not be zero; the height of a capsule may be given by its ends."""
LEAST_MASS = 0.001
LEAST_INERTIA = 1e-6
"""Least mass [kg] and least moments of inertia [kg m^2] of a moving body."""
STICK = 0.015
"""Radius of the sticks that are drawn for a robot without shapes [m]."""
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@dataclass(frozen=True, slots=True)
class Mended:
    """A record of the repairs of a robot's or target's model: shapes and textures that were left
    out, each with the reason (`lost`), and names of bodies whose impossible or incomplete mass or
    inertia was replaced (`corrected`). As a text it lists both; the text is empty if there were no
    repairs.
    """

    lost: list[Lost] = field(default_factory=list)
    """Shapes and textures that are not drawn, with the reason."""
    corrected: list[str] = field(default_factory=list)
    """Names of bodies whose impossible or incomplete mass or inertia was replaced."""

    def __str__(self) -> str:
        said = [f"not drawn: {listed(self.lost)}"] if self.lost else []
        if self.corrected:
            said.append(f"mass or inertia corrected: {first_of(self.corrected)}")
        return "; ".join(said)


def mend(spec: mujoco.MjSpec, path: Path, mended: Mended, *, whole: bool) -> mujoco.MjModel:
    """Repair the meshes, masses and inertias of a model that MuJoCo refuses, and leave out shapes
    and textures that cannot be repaired; return the compiled model.

    Args:
        spec: The model, which is changed.
        path: The model's file, around which meshes and textures are searched for.
        mended: Record to which the repairs are added.
        whole: True: leave nothing out, so that MuJoCo refuses a model with a shape or texture that
            cannot be repaired.

    Raises:
        ValueError: MuJoCo refuses the repaired model.
    """
    _correct_weights(spec, mended)
    if not whole:
        _leave_out_sizes(spec, mended)
        _leave_out_textures(spec, path, mended)
    _replace_meshes(spec, path, mended, whole=whole)
    return compiled(spec.copy())


def draw_sticks(spec: mujoco.MjSpec) -> None:
    """Make a robot without shapes visible: add a stick (a capsule of 15 mm radius, without mass) to
    its model from each body's parent to the body, unless the two are less than 15 mm apart.
    """
    for body in spec.bodies[1:]:
        if np.linalg.norm(body.pos) > STICK:
            body.parent.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[0, 0, 0, *body.pos],
                size=[STICK, 0, 0],
                mass=0,
            )


def _correct_weights(spec: mujoco.MjSpec, mended: Mended) -> None:
    """Replace impossible masses and inertias: an inertia by the mean of its principal moments;
    too small ones become `LEAST_MASS` and `LEAST_INERTIA`.
    """
    is_bounded = spec.compiler.boundmass > 0
    spec.compiler.balanceinertia = True
    spec.compiler.boundmass = max(spec.compiler.boundmass, LEAST_MASS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, LEAST_INERTIA)
    for body in spec.bodies:
        if not is_bounded and body.joints and _is_light(body):
            mended.corrected.append(body.name)
        if not np.isfinite([body.mass, *body.inertia]).all():
            body.mass = np.nan_to_num(body.mass, posinf=0, neginf=0)
            body.inertia = np.zeros(3)
            mended.corrected.append(body.name)
        xx, yy, zz, xy, xz, yz = body.fullinertia
        if np.isnan(xx):
            continue  # it is not given in this way
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        parts = np.linalg.eigvalsh(matrix) if np.isfinite(matrix).all() else np.zeros(3)
        if not (parts > 0).all():
            body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
            body.inertia = np.full(3, np.abs(parts).mean())
            mended.corrected.append(body.name)


def _is_light(body: mujoco.MjsBody) -> bool:
    """Return whether a moving body has no mass, or moments of inertia that no body has."""
    if not body.explicitinertial:
        return not any(geom.mass > 0 or np.isnan(geom.mass) for geom in body.geoms)
    least, middle, largest = sorted(body.inertia)
    return bool(body.mass <= 0 or least + middle < largest)


def _leave_out_sizes(spec: mujoco.MjSpec, mended: Mended) -> None:
    for geom in list(spec.geoms):
        sizes = geom.size[: SIZES.get(geom.type, 0)]
        if not geom.meshname and not (sizes > 0).all():
            mended.lost.append((f"a shape of '{geom.parent.name}'", "it has no size"))
            spec.delete(geom)


def _leave_out_textures(spec: mujoco.MjSpec, path: Path, mended: Mended) -> None:
    for texture in list(spec.textures):
        if texture.file and not _file_of(texture.file, path).is_file():
            for material in spec.materials:
                for role, name in enumerate(material.textures):
                    if name == texture.name:
                        material.textures[role] = ""
            mended.lost.append((texture.file, "no such file"))
            spec.delete(texture)


def _replace_meshes(spec: mujoco.MjSpec, path: Path, mended: Mended, *, whole: bool) -> None:
    """Read the meshes that MuJoCo refuses with trimesh instead; leave out those that trimesh cannot
    read either, unless `whole` is set.
    """
    for shape in spec.meshes:
        shape.name = shape.name or Path(shape.file).stem  # as MuJoCo names it
    wrong = [shape for shape in spec.meshes if not _compiles(spec, shape.name)]
    for shape in wrong:
        file = _file_of(shape.file, path)
        try:
            if shape.file:
                fill(shape, read_mesh(file, (file.suffix.lower(),)), None)
            for geom in geoms_of(spec, shape):
                geom.contype = geom.conaffinity = 0  # a flat mesh has no convex hull
            why = "" if _compiles(spec, shape.name) else "it has no area"
        except ValueError:
            why = why_not(file)
        if why and not whole:
            mended.lost.append((file.name or shape.name, why))
            for element in [*geoms_of(spec, shape), shape]:
                spec.delete(element)


def geoms_of(spec: mujoco.MjSpec, shape: mujoco.MjsMesh) -> list[mujoco.MjsGeom]:
    """Return all geoms of a model that show the mesh `shape`."""
    return [geom for geom in spec.geoms if geom.meshname == shape.name]


def _compiles(spec: mujoco.MjSpec, name: str) -> bool:
    """Return whether a model compiles if all meshes but one are replaced by a tetrahedron."""
    alone = spec.copy()
    for shape in alone.meshes:
        if shape.name != name:
            shape.file = ""
            shape.uservert = TETRAHEDRON.ravel()
            shape.userface = SIDES.ravel()
    try:
        compiled(alone)
    except ValueError:
        return False
    return True


def _file_of(name: str, path: Path) -> Path:
    """Return the path of a model's mesh or picture by the name in the model; the file may not
    exist.
    """
    parts = tuple(part for part in Path(name).parts if part not in ("..", "."))
    found = [file for file in files_behind(path) if file.parts[-len(parts) :] == parts]
    return min(found, default=Path(name))
