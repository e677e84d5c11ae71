"""The renderer that needs no graphics driver, and gives the same pictures on every machine.

It draws what MuJoCo's own renderer draws of geoms and sites, with its shapes, lights and textures,
but for shadows, reflections and haze. A triangle's colour is that of its corners, as there.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera.exact import raster
from sim.camera.exact.solids import materials_of, solids_of, texture_of
from sim.camera.renderer import camera_pose
from sim.types import Array, Camera, Image, Pose

DEFAULT_SHINE = (0.0, 0.5, 0.5)
"""MuJoCo's emission, specular reflection and shininess of a body without a material."""
DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
"""A body of this colour has that of its material: MuJoCo's rule."""
HARDEST = 128.0
"""OpenGL's exponent of the specular reflection where MuJoCo's shininess is 1."""
SOLID = 0.995
"""Least alpha of a body that nothing shines through: MuJoCo's rule."""
FULL = (1.0, 0.0, 0.0)
"""Attenuation of a lamp that does not fade."""
CHANNEL = 21
"""Bits for a colour's channel in a texel; sums with weights up to 4096 fit."""
NO_BODY = -1


class ExactRenderer:
    """Draws a model's camera with IEEE arithmetic in a fixed order; see `Renderer`.

    Raises:
        ValueError: The model has bodies that it cannot draw.
    """

    def __init__(self, model: mujoco.MjModel, camera: str, view: Camera) -> None:
        _check(model)
        self._model = model
        self._camera = int(model.camera(camera).id)
        self._view = np.array([view.fx, view.fy, view.cx, view.cy])
        surfaces = solids_of(model)
        counts = np.array([len(s.corners) // 3 for s in surfaces])
        self._first = np.concatenate([[0], np.cumsum(counts)])
        self._corners = np.concatenate([s.corners for s in surfaces])
        self._normals = np.concatenate([s.normals for s in surfaces])
        self._places = np.concatenate([s.texture for s in surfaces])
        self._faces = _faces(self._corners, self._normals)
        self._radii = np.array([np.linalg.norm(s.corners, axis=1).max(initial=0) for s in surfaces])
        self._rgba, self._shine = _looks(model)
        self._is_shown = _shown(model) & (counts > 0)
        self._texels, self._levels = _textures(model)
        self._textures = np.array([texture_of(model, m) for m in materials_of(model)]) + 1
        self._sky = _sky(model)
        self._nearest = 1.0 / (model.vis.map.zfar * model.stat.extent)
        shape = (view.height, view.width)
        self._nearness = np.empty(shape)
        self._shown = np.empty(shape, np.int64)

    def close(self) -> None:
        """Do nothing: it holds arrays alone."""

    def render(self, data: mujoco.MjData) -> Image:
        """A new RGB picture (H, W, 3) of the scene as it is."""
        eye = camera_pose(data, self._camera)
        solid = self._rgba[:, 3] >= SOLID
        image = self._begin()
        order = self._nearest_first(data, eye, self._is_shown & solid)
        self._draw(data, eye, order, self._rgba, image)
        if self._sky is not None:
            texels, side = self._sky
            raster.fill_sky(texels, side, eye.rotation, self._view, image, self._shown)
        clear = self._nearest_first(data, eye, self._is_shown & ~solid)
        if len(clear):
            # To the farthest and back again: MuJoCo's way where what is clear overlaps.
            self._draw(data, eye, np.concatenate([clear, clear[::-1]]), self._rgba, image)
        return image

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        """Return a mask of the pixels that show one of the geoms; see `Renderer`."""
        wanted = np.concatenate([geoms, np.zeros(self._model.nsite, bool)])
        opaque = self._rgba.copy()
        opaque[:, 3] = 1.0
        drawn = self._is_shown & wanted if alone else self._is_shown
        eye = camera_pose(data, self._camera)
        order = self._nearest_first(data, eye, drawn)
        self._draw(data, eye, order, opaque, self._begin())
        return np.append(wanted, False)[self._shown]

    def _nearest_first(
        self, data: mujoco.MjData, eye: Pose, drawn: NDArray[np.bool_]
    ) -> NDArray[np.intp]:
        """Numbers of these bodies; what lies behind others then costs a comparison a pixel."""
        chosen = np.flatnonzero(drawn)
        depth = (_centres(data)[chosen] - eye.translation) @ eye.rotation[:, 2]
        return chosen[np.argsort(depth, kind="stable")]

    def _begin(self) -> Image:
        self._nearness.fill(self._nearest)
        self._shown.fill(NO_BODY)
        return np.zeros((*self._shown.shape, 3), np.uint8)

    def _draw(
        self, data: mujoco.MjData, eye: Pose, order: NDArray[np.intp], rgba: Array, image: Image
    ) -> None:
        to_camera = eye.rotation.T
        poses = np.concatenate([data.geom_xmat, data.site_xmat]).reshape(-1, 3, 3)
        model = self._model
        raster.draw(
            order,
            self._first,
            self._corners,
            self._normals,
            self._faces,
            self._places,
            to_camera @ poses,
            (_centres(data) - eye.translation) @ eye.rotation,
            self._radii,
            rgba,
            self._shine,
            self._textures,
            _lights(model, data, eye),
            model.vis.map.znear * model.stat.extent,
            self._view,
            self._texels,
            self._levels,
            image,
            self._nearness,
            self._shown,
        )


def _check(model: mujoco.MjModel) -> None:
    for count, name in (
        (model.nhfield, "height fields"),
        (model.nflex, "soft bodies (flex)"),
        (model.nskin, "skins"),
    ):
        if count:
            raise ValueError(
                f'the renderer "exact" does not draw {name}; camera.renderer = "opengl" does'
            )


def _centres(data: mujoco.MjData) -> Array:
    return np.concatenate([data.geom_xpos, data.site_xpos])


def _faces(corners: Array, normals: Array) -> Array:
    """Of each triangle, normal and distance of its plane, and whether its normals agree (n, 5)."""
    a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    each = normals.reshape(-1, 3, 3)
    agree = (each == each[:, :1]).all(axis=(1, 2))
    return np.column_stack([across, np.sum(across * a, axis=1), agree])


def _looks(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Colours (n, 4), and emission, specular reflection and its exponent (n, 3), of all bodies."""
    rgba = np.concatenate([model.geom_rgba, model.site_rgba]).astype(float)
    material = np.concatenate([model.geom_matid, model.site_matid])
    shine = np.tile(DEFAULT_SHINE, (len(rgba), 1))
    has = material >= 0
    own = material[has]
    shine[has] = np.column_stack([model.mat_emission, model.mat_specular, model.mat_shininess])[own]
    taken = has & (rgba.astype(np.float32) == np.array(DEFAULT_RGBA, np.float32)).all(axis=1)
    rgba[taken] = model.mat_rgba[material[taken]]
    return rgba, shine * (1.0, 1.0, HARDEST)


def _shown(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Whether each geom and site is in a group that is drawn, and is not quite clear."""
    option = mujoco.MjvOption()
    groups = [option.geomgroup[model.geom_group], option.sitegroup[model.site_group]]
    alpha = np.concatenate([model.geom_rgba[:, 3], model.site_rgba[:, 3]])
    return np.concatenate(groups).astype(bool) & (alpha > 0)


def _lights(model: mujoco.MjModel, data: mujoco.MjData, eye: Pose) -> Array:
    """Lights that are on, in the camera's frame: a row each, as `raster` has its columns."""
    on = model.light_active.astype(bool)
    is_near = model.light_type[on] != mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    along = data.light_xdir[on] @ eye.rotation
    places = (data.light_xpos[on] - eye.translation) @ eye.rotation
    cosines = np.where(is_near, np.cos(np.radians(model.light_cutoff[on])), -np.inf)
    lamps = np.column_stack(
        [
            np.where(is_near[:, None], places, -along),
            is_near,
            along,
            model.light_ambient[on],
            model.light_diffuse[on],
            model.light_specular[on],
            np.where(is_near[:, None], model.light_attenuation[on], FULL),
            cosines,
            np.where(is_near, model.light_exponent[on], 0.0),
        ]
    )
    head = model.vis.headlight
    colours = [*head.ambient, *head.diffuse, *head.specular]
    own = np.array([[0, 0, -1, 0, 0, 0, 1, *colours, *FULL, -np.inf, 0]])
    return np.concatenate([own, lamps]) if head.active else lamps


def _picture(model: mujoco.MjModel, texture: int) -> Image:
    shape = (model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture])
    start = int(model.tex_adr[texture])
    picture = model.tex_data[start : start + int(np.prod(shape))].reshape(shape)
    return np.broadcast_to(picture[..., :1], (*shape[:2], 3)) if shape[2] < 3 else picture[..., :3]


def _textures(model: mujoco.MjModel) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """White, then the model's pictures: their pixels, and a table of the levels of each.

    A cube around a body is not drawn: its mean colour stands for it.
    """
    pictures = [np.full((1, 1, 3), 255, np.uint8)]
    for texture in range(model.ntex):
        picture = _picture(model, texture)
        if model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D:
            picture = picture.mean(axis=(0, 1), keepdims=True).astype(np.uint8)
        pictures.append(picture)
    texels = list[NDArray[np.int64]]()
    table = np.zeros((len(pictures), max(max(p.shape) for p in pictures).bit_length(), 4), np.int64)
    for k, picture in enumerate(pictures):
        levels = _levels(picture)
        for i, level in enumerate(levels):
            table[k, i] = (sum(map(len, texels)), level.shape[1], level.shape[0], len(levels))
            texels.append(_packed(np.pad(level, ((1, 1), (1, 1), (0, 0)), mode="wrap")))
    return np.concatenate(texels), table


def _sky(model: mujoco.MjModel) -> tuple[NDArray[np.int64], int] | None:
    """The six pictures of the sky, and the side of each; None where there is no sky."""
    for texture in np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)[:1]:
        picture = _picture(model, int(texture))
        return _packed(picture), picture.shape[1]
    return None


def _levels(picture: Image) -> list[Image]:
    """A picture and its halves down to one pixel, each the mean of four pixels of the last."""
    levels = [picture]
    while max(levels[-1].shape[:2]) > 1:
        last = levels[-1].astype(np.uint16)
        rows, columns = (_pairs(size) for size in last.shape[:2])
        total = last[rows].sum(axis=1)[:, columns].sum(axis=2)
        levels.append(((total + 2) // 4).astype(np.uint8))
    return levels


def _pairs(size: int) -> NDArray[np.intp]:
    return np.minimum(2 * np.arange(max(size // 2, 1))[:, None] + (0, 1), size - 1)


def _packed(picture: Image) -> NDArray[np.int64]:
    red, green, blue = picture.reshape(-1, 3).astype(np.int64).T
    return red | green << CHANNEL | blue << 2 * CHANNEL
