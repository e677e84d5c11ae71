"""Meshes, colours and pictures added to MuJoCo models."""

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.files.picture_file import shrunk
from sim.models.mesh_file import Material, Triangles
from sim.types import Image

PICTURE = "picture"


def fill(shape: mujoco.MjsMesh, mesh: Triangles, material: Material | None) -> None:
    """Replace the content of a mesh in a MuJoCo model by triangles.

    Args:
        shape: The mesh in the model, which is changed.
        mesh: The triangles.
        material: Material of the triangles; only if it has a picture are the triangles' texture
            coordinates added. None: no material.
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
    """Give a mesh in a model several materials. MuJoCo draws one material for each geom, so the
    triangles of each material become a mesh of their own, with a geom beside each geom of the whole
    mesh. None of these geoms collides any more, and the added ones have no mass.

    Args:
        spec: The model, which is changed.
        shape: The mesh in the model, which keeps the triangles of the first material.
        geoms: All geoms that show this mesh.
        parts: Pairs of the triangles of a material, and the material; None leaves a given geom its
            colour, and an added one MuJoCo's grey.
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
    """Give a geom in a model the colour of a material, or its picture. For a picture, a material
    called `name` is added to the model, unless it has one of this name.
    """
    if material.picture is None:
        geom.rgba = material.colour
    elif spec.material(name) is None:
        geom.material = add_picture(spec, material.picture, name)
    else:
        geom.material = name


def add_picture(spec: mujoco.MjSpec, picture: Image, name: str = PICTURE) -> str:
    """Add a material called `name` that shows a picture, RGB (H, W, 3), to a model; return this
    name. A picture of more than 2048 px a side is made smaller.
    """
    lay(spec, shrunk(picture), spec.add_material(name=name, specular=0, shininess=0), name)
    return name


def lay(spec: mujoco.MjSpec, picture: Image, material: mujoco.MjsMaterial, name: str) -> None:
    """Add a picture (H, W, channels), uint8, to a model as a texture called `name`, and make it the
    colour texture of a material of this model.
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


def picture_of(model: mujoco.MjModel, texture: int) -> Image:
    """Return the pixels of a texture of a compiled model as RGB (H, W, 3), uint8: grey if the
    texture has one or two channels; a fourth channel is left out.
    """
    shape = (model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture])
    start = int(model.tex_adr[texture])
    picture = model.tex_data[start : start + int(np.prod(shape))].reshape(shape)
    return np.broadcast_to(picture[..., : 1 if shape[2] < 3 else 3], (*shape[:2], 3))
