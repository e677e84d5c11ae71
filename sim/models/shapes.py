"""Meshes, colours and pictures added to MuJoCo models."""

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.files.picture_file import shrunk
from sim.models.mesh_file import Material, Triangles
from sim.types import Image

PICTURE = "picture"


def fill(shape: mujoco.MjsMesh, mesh: Triangles, material: Material | None) -> None:
    """Replace the content of a model's mesh by triangles.

    Args:
        shape: The mesh of the model, which is changed.
        mesh: The triangles.
        material: Material of the triangles; texture coordinates are added only if it has a picture.
            None: no material.
    """
    shape.file = ""
    shape.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # it may be flat
    vertices = mesh.vertices
    # MuJoCo wants four, of a triangle too.
    shape.uservert = np.concatenate(
        [vertices, vertices[:1]] if len(vertices) < 4 else [vertices]
    ).ravel()
    shape.userface = mesh.faces.ravel()
    if material is not None and material.picture is not None and mesh.places is not None:
        # Triangles without places are left where they fall; the places of others are right.
        shape.usertexcoord = np.nan_to_num(mesh.places * (1, -1) + (0, 1)).ravel()
        shape.userfacetexcoord = np.arange(mesh.faces.size)


def show(
    spec: mujoco.MjSpec,
    shape: mujoco.MjsMesh,
    geoms: Sequence[mujoco.MjsGeom],
    parts: Sequence[tuple[Triangles, Material | None]],
) -> None:
    """Show a mesh that has several materials. MuJoCo draws one material for each geom, so each part
    of one material becomes a mesh of its own, with a geom beside each geom of the whole mesh.

    Args:
        spec: The model, which is changed.
        shape: The mesh of the model, which becomes the first part.
        geoms: Geoms of this mesh.
        parts: Triangles and their material; None keeps the geom's colour.
    """
    for k, (part, material) in enumerate(parts):
        name = f"{shape.name}_{k}" if k else shape.name
        fill(spec.add_mesh(name=name, scale=shape.scale) if k else shape, part, material)
        for geom in geoms:
            drawn = _twin(geom, name) if k else geom
            drawn.contype = drawn.conaffinity = 0  # a flat part has no convex hull
            if material is not None:
                paint(spec, drawn, material, name)


def _twin(geom: mujoco.MjsGeom, mesh: str) -> mujoco.MjsGeom:
    """Add a geom with another mesh at the place of a geom, without mass, and return it."""
    return geom.parent.add_geom(
        type=geom.type, meshname=mesh, pos=geom.pos, quat=geom.quat, group=geom.group, mass=0
    )


def paint(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, material: Material, name: str) -> None:
    """Give a geom the colour or the picture of a material; `name` is the name that the model's
    material for the picture has or gets.
    """
    if material.picture is None:
        geom.rgba = material.colour
    elif spec.material(name) is None:
        geom.material = add_picture(spec, material.picture, name)
    else:
        geom.material = name


def add_picture(spec: mujoco.MjSpec, picture: Image, name: str = PICTURE) -> str:
    """Add a picture (H, W, 3), reduced to at most 2048 px a side, to a model as a material called
    `name`; return this name.
    """
    lay(spec, shrunk(picture), spec.add_material(name=name, specular=0, shininess=0), name)
    return name


def lay(spec: mujoco.MjSpec, picture: Image, material: mujoco.MjsMaterial, name: str) -> None:
    """Add a picture (H, W, 3) to a model as a texture called `name`, and set it as a material's
    texture.
    """
    height, width, channels = picture.shape
    texture = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=width,
        height=height,
        nchannel=channels,
    )
    texture.data = picture.tobytes()
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
