"""The software renderer: it needs no graphics driver, and gives the same pictures on every machine.

It draws geoms and sky with the shapes, lights and textures of MuJoCo's own renderer, but without
reflections, haze, translucence and the shadows of lamps, and with the mean colour of a cube map in
its place. As in MuJoCo, light is computed at the corners of triangles.
"""

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera import gl
from sim.camera.exact import raster, shadows
from sim.camera.exact.solids import face_normals, sky_of, solids_of, texture_of
from sim.camera.renderer import TABLE, Backdrop, DepthPromise, Promise, T, camera_pose
from sim.models.shapes import picture_of
from sim.types import Array, Camera, DepthPicture, Image, Pose

DEFAULT_SHINE = (0.0, 0.5, 0.5)
"""MuJoCo's emission, specular reflection and shininess of a body without a material."""
DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
"""A body of this colour has that of its material: MuJoCo's rule."""
HARDEST = 128.0
"""OpenGL's exponent of the specular reflection where MuJoCo's shininess is 1."""
FULL = (1.0, 0.0, 0.0)
"""Attenuation of a lamp that does not fade."""
CHANNEL = 21
"""Bits for a colour's channel in a texel; sums with weights up to 4096 fit."""
NO_BODY = -1


class ExactRenderer:
    """Software renderer for a camera of a MuJoCo model (by its name) with the intrinsics `view`. It
    gives the same pictures on every machine, and has the methods of the protocol
    `sim.camera.renderer.Renderer`. With `fine` it mixes two mipmap levels of a texture, as OpenGL
    does; with `shaded` it draws soft shadows on the table.

    The sky is drawn as one more body after all geoms, which emits light and moves with the camera.

    Raises:
        ValueError: The model has height fields, soft bodies (flex) or skins, which are not drawn.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        camera: str,
        view: Camera,
        *,
        fine: bool = False,
        shaded: bool = False,
    ) -> None:
        """Read the model's shapes and textures.

        Args:
            model: The scene.
            camera: Name of its camera.
            view: Intrinsics of the pictures.
            fine: Whether two levels of a texture are mixed (trilinear filtering), as in OpenGL, and
                places in a texture are computed more often.
            shaded: Whether a soft shadow is drawn on the scene's table under each thing on it.
        """
        _check(model)
        self._fine = fine
        self._model = model
        self._camera = int(model.camera(camera).id)
        self._view = np.array([view.fx, view.fy, view.cx, view.cy])
        sky = next(iter(np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)), -1)
        side = int(model.tex_width[sky]) if sky >= 0 else 1
        solids = [*solids_of(model), sky_of(side, model.vis.map.zfar * model.stat.extent)]
        counts = np.array([len(solid) // 3 for solid in solids])
        every = np.concatenate(solids)
        # Coordinates that begin near 0: a texture is left as seldom as can be.
        every[:, 6:] -= np.floor(every[:, 6:].reshape(-1, 3, 2).min(axis=1)).repeat(3, axis=0)
        bodies = np.repeat(np.arange(len(solids)), 3 * counts)
        rows, numbers = np.unique(np.column_stack([bodies, every]), axis=0, return_inverse=True)
        self._rows = rows[:, 1:].astype(float)
        """The different corners of each body: position [m], normal and texture coordinates in the
        body's frame (n, 8)."""
        self._first_row = np.searchsorted(rows[:, 0], np.arange(len(solids) + 1))
        self._faces = numbers.reshape(-1, 3)
        """Rows of `_rows` of the corners of each triangle (f, 3)."""
        self._first_face = np.concatenate([[0], np.cumsum(counts)])
        plane = face_normals(every[:, :3])
        self._planes = np.column_stack([plane, np.sum(plane * every[::3, :3], axis=1)])
        """Normal and distance of each triangle's plane in the body's frame, both multiplied by
        twice the triangle's area (f, 4)."""
        self._radii = np.array([np.linalg.norm(s[:, :3], axis=1).max(initial=0) for s in solids])
        self._rgba, self._shine = _looks(model)
        visible = mujoco.MjvOption().geomgroup[model.geom_group] * self._rgba[: model.ngeom, 3] > 0
        self._is_shown = np.append(visible, sky >= 0) & (counts > 0)
        self._backdrop = Backdrop(model, view)
        self._before_table = self._is_shown.copy()
        self._before_table[[*self._backdrop.floor, model.ngeom]] = False
        """Mask of the bodies to draw where the table hides floor and sky."""
        self._table = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, TABLE)
        """Id of the table's geom; -1: the scene has none."""
        # A mesh of the world holds many things, and not all stand on the table: the walls, and
        # clutter with a picture.
        many = (model.geom_bodyid == 0) & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
        is_table = np.arange(model.ngeom) == self._table
        casts = self._is_shown[:-1] & ~is_table & ~many & shaded
        self._things = shadows.Things.of(model, casts & (self._table >= 0))
        self._texels, self._levels = _textures(model)
        self._textures = np.array([*(texture_of(model, g) for g in range(model.ngeom)), sky]) + 1
        shape = (view.height, view.width)
        self._nearness = np.empty(shape, np.float32)
        self._shown = np.empty(shape, np.int16)

    def close(self) -> None:
        """Do nothing: this renderer holds no buffers to release."""

    def begin(self, data: mujoco.MjData) -> Promise:
        """Begin to render the scene in MuJoCo's state `data`, which may change afterwards. Return a
        function that waits for the picture, RGB, uint8 (H, W, 3), and returns it.
        """
        hidden = self._backdrop.is_hidden(data, self._camera)
        drawn = self._before_table if hidden else self._is_shown
        if not len(self._things.halves):
            return self._draw(data, drawn).result
        eye = camera_pose(data, self._camera)
        return self._draw(data, drawn, partial(self._shaded, self._things.places(data), eye)).result

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        """Return a mask (H, W), true where the picture of the scene in `data` shows a geom that
        `geoms`, a mask over the ids of all geoms (ngeom,), selects. With `alone` only the selected
        geoms are drawn, so that no other geom hides them.
        """
        wanted = np.append(geoms, False)
        self._draw(data, self._is_shown & wanted if alone else self._is_shown).result()
        return np.append(wanted, False)[self._shown]

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        """Begin to render the depths of the scene in MuJoCo's state `data`, which may change
        afterwards. Return a function that waits for the distances along the optical axis, float32
        (H, W) [m], and returns them; inf where no geom is.
        """
        is_geom = np.arange(len(self._is_shown)) < self._model.ngeom
        return self._draw(data, self._is_shown & is_geom, self._depths).result

    def _depths(self, _image: Image) -> DepthPicture:
        with np.errstate(divide="ignore"):
            return np.float32(1.0) / self._nearness

    def _draw(
        self,
        data: mujoco.MjData,
        drawn: NDArray[np.bool_],
        read: Callable[[Image], T] = lambda image: image,
    ) -> Future[T]:
        """Begin a picture of the bodies (geoms, and last the sky) that the mask `drawn` (n,)
        selects, as they are in MuJoCo's state `data`.

        Returns:
            Future of the result of `read`, a function that is called with the picture.
        """
        eye = camera_pose(data, self._camera)
        chosen = np.flatnonzero(drawn)
        to_camera = eye.rotation.T
        rotations = np.concatenate([data.geom_xmat.reshape(-1, 3, 3), np.eye(3)[None]])
        middles = (np.vstack([data.geom_xpos, eye.translation]) - eye.translation) @ eye.rotation
        # The nearest first: what lies behind others then costs a comparison a pixel. The sky, in
        # whose middle the camera is, comes last.
        depth = np.where(chosen < self._model.ngeom, middles[chosen, 2], np.inf)
        return gl.rendering().submit(
            self._fill,
            read,
            chosen[np.argsort(depth, kind="stable")],
            to_camera @ rotations,
            middles,
            _lights(self._model, data, to_camera, eye.translation),
        )

    def _fill(
        self,
        read: Callable[[Image], T],
        order: NDArray[np.intp],
        rotations: Array,
        middles: Array,
        lights: Array,
    ) -> T:
        image = np.zeros((*self._shown.shape, 3), np.uint8)
        self._nearness.fill(0.0)
        self._shown.fill(NO_BODY)
        raster.draw(
            order,
            self._first_row,
            self._rows,
            self._first_face,
            self._faces,
            self._planes,
            rotations,
            middles,
            self._radii,
            self._rgba,
            self._shine,
            self._textures,
            lights,
            self._model.vis.map.znear * self._model.stat.extent,
            self._view,
            self._texels,
            self._levels,
            self._fine,
            image,
            self._nearness,
            self._shown,
        )
        return read(image)

    def _shaded(self, places: tuple[Array, Array], eye: Pose, image: Image) -> Image:
        """Draw the shadows of things into a picture, and return the picture.

        Args:
            places: Rotations (n, 3, 3) and middles (n, 3) [m] of the things' boxes in the world.
            eye: Pose T_world_camera of the camera.
            image: The picture, RGB (H, W, 3), written.
        """
        shadows.shade(
            image,
            self._shown,
            self._table,
            self._things.halves,
            *places,
            eye.rotation,
            eye.translation,
            self._view,
        )
        return image


def _check(model: mujoco.MjModel) -> None:
    for count, name in (
        (model.nhfield, "height fields"),
        (model.nflex, "soft bodies (flex)"),
        (model.nskin, "skins"),
    ):
        if count:
            raise ValueError(
                f'the model has {name}, which the renderer "exact" does not draw: remove them, or '
                'use camera.renderer = "opengl" on a machine with OpenGL'
            )


def _looks(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Return the colours (n, 4), 0 to 1, of all bodies (geoms and sky), and their emission,
    specular reflection and specular exponent (n, 3).
    """
    rgba = model.geom_rgba.astype(float)
    shine = np.tile(DEFAULT_SHINE, (len(rgba), 1))
    has = model.geom_matid >= 0
    own = model.geom_matid[has]
    shine[has] = np.column_stack([model.mat_emission, model.mat_specular, model.mat_shininess])[own]
    taken = has & (model.geom_rgba == np.array(DEFAULT_RGBA, np.float32)).all(axis=1)
    rgba[taken] = model.mat_rgba[model.geom_matid[taken]]
    shine = np.vstack([shine, (1.0, 0.0, 0.0)]) * (1.0, 1.0, HARDEST)
    return np.vstack([rgba, np.ones(4)]), shine


def _lights(model: mujoco.MjModel, data: mujoco.MjData, to_camera: Array, eye: Array) -> Array:
    """Return the active lights (n, 21), the headlight included, in the camera's frame, with the
    columns that `raster.lit` lists.

    Args:
        model: The scene.
        data: MuJoCo's state of the scene.
        to_camera: Rotation R_camera_world (3, 3).
        eye: Position of the camera in the world (3,) [m].
    """
    on = model.light_active.astype(bool)
    is_near = model.light_type[on] != mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    along = data.light_xdir[on] @ to_camera.T
    places = (data.light_xpos[on] - eye) @ to_camera.T
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
    """Return a texture's pixels, RGB (h, w, 3); in place of a cube map, which is not drawn, one
    pixel (1, 1, 3) of its mean colour.
    """
    picture = picture_of(model, texture)
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
        picture = picture.mean(axis=(0, 1), keepdims=True).astype(np.uint8)
    return picture


def _textures(model: mujoco.MjModel) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pixels of all textures, white first and then those of the model, and the table of
    the levels of each texture (t, n, 4), both as `raster.fill` reads them.
    """
    white = np.full((1, 1, 3), 255, np.uint8)
    pictures = [white, *(_picture(model, k) for k in range(model.ntex))]
    texels = list[NDArray[np.int64]]()
    table = np.zeros((len(pictures), max(max(p.shape) for p in pictures).bit_length(), 4), np.int64)
    for k, picture in enumerate(pictures):
        levels = _levels(picture)
        for i, level in enumerate(levels):
            table[k, i] = (sum(map(len, texels)), level.shape[1], level.shape[0], len(levels))
            bordered = np.pad(level, ((1, 1), (1, 1), (0, 0)), mode="wrap").astype(np.int64)
            texels.append((bordered << (0, CHANNEL, 2 * CHANNEL)).sum(axis=2).ravel())
    return np.concatenate(texels), table


def _levels(picture: Image) -> list[Image]:
    """Return the levels of detail (mipmap) of a picture: each is half as large, with means of four
    pixels, down to one row or column.
    """
    levels = [picture]
    while min(levels[-1].shape[:2]) > 1:
        rows, columns = (size // 2 for size in levels[-1].shape[:2])
        fours = levels[-1][: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3)
        levels.append(((fours.sum(axis=(1, 3), dtype=np.uint16) + 2) // 4).astype(np.uint8))
    return levels
