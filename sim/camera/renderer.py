"""Rendering: off-screen pinhole pictures of the scene, and where geoms are in them.

Here MuJoCo's camera frame (x right, y up, looking along -z) becomes the vision frame (x right, y
down, z forward), and nowhere else.
"""

from collections.abc import Callable
from typing import Protocol

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera import gl
from sim.camera.camera import pinhole
from sim.types import Array, Camera, Image, Pose

VISION_FROM_MUJOCO = np.diag([1.0, -1.0, -1.0])
ALONE = 5
"""A group of geoms that MuJoCo does not draw by itself."""
PIXEL = 1e-5
"""Size of a pixel on the sensor of a camera that is not centred [m]; any would do."""


def camera_pose(data: mujoco.MjData, camera: int) -> Pose:
    """T_world_camera in the vision frame, as of the last kinematics."""
    return Pose(
        data.cam_xmat[camera].reshape(3, 3) @ VISION_FROM_MUJOCO, data.cam_xpos[camera].copy()
    )


ELSEWHERE = (
    "This world was made in another thread or process, which alone can render it: make a world "
    'where it is used; worker processes may be started with context="spawn".'
)


class Renderer(Protocol):
    """Takes pinhole pictures of a scene; `World` takes any class that has these three methods."""

    def render(self, data: mujoco.MjData) -> Image:
        """A new RGB picture (H, W, 3) of the scene as it is."""
        ...

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        """Return a mask (rows, columns) of the pixels that show one of the geoms.

        Args:
            data: The scene as it is.
            geoms: A mask over geom ids.
            alone: Draw nothing but these geoms.
        """
        ...

    def close(self) -> None:
        """Give back what it holds."""
        ...


MakeRenderer = Callable[[mujoco.MjModel, str, Camera], Renderer]
"""Makes the renderer of a model's camera, by its name, with the intrinsics of the pictures, which
have no distortion."""


class OpenGLRenderer:
    """MuJoCo's own renderer, into memory. Holds GL buffers: close it."""

    def __init__(self, model: mujoco.MjModel, camera: str, view: Camera) -> None:
        if pinhole(model, camera, view.width, view.height) != view:
            _aim(model, camera, view)
        offscreen = model.vis.global_
        offscreen.offwidth = view.width
        offscreen.offheight = view.height
        self._gl = gl.make_current()
        self._model = model
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        try:
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError as error:
            raise gl.NoRenderer(
                f"MuJoCo cannot render with the OpenGL of this machine ({gl.describe()}): {error}."
            ) from None
        self._rect = mujoco.MjrRect(0, 0, view.width, view.height)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._option = mujoco.MjvOption()
        self._upside_down = np.empty((view.height, view.width, 3), np.uint8)

    def close(self) -> None:
        if gl.make_current() is self._gl:  # another context has other buffers of these numbers
            self._context.free()

    def render(self, data: mujoco.MjData) -> Image:
        self._draw(data)
        return cv2.flip(self._upside_down, 0)  # type: ignore[return-value]

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        group = self._model.geom_group.copy()
        shown = self._option.geomgroup.copy()
        if alone:
            self._model.geom_group[geoms & shown[group].astype(bool)] = ALONE
            self._option.geomgroup[:] = np.arange(len(shown)) == ALONE
        self._draw(data)
        self._model.geom_group[:] = group
        self._option.geomgroup[:] = shown
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        wanted = np.zeros(self._scene.ngeom + 1, bool)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                wanted[geom.segid + 1] = geoms[geom.objid]
        codes = self._upside_down.astype(np.int64) @ (1, 1 << 8, 1 << 16)
        return wanted[codes[::-1]]

    def _draw(self, data: mujoco.MjData) -> None:
        if gl.make_current() is not self._gl:
            raise gl.NoRenderer(ELSEWHERE)
        # Worlds that are open at the same time share the context, and draw into their own buffers.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._camera, every, self._scene
        )
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._upside_down, None, self._rect, self._context)


def _aim(model: mujoco.MjModel, name: str, view: Camera) -> None:
    """Give a model's camera these intrinsics: what `pinhole` reads, backwards."""
    camera = model.camera(name).id
    size = np.array([view.width, view.height])
    offset = size / 2 - (view.cx, view.cy)
    model.cam_sensorsize[camera] = size * PIXEL
    model.cam_intrinsic[camera] = np.array([view.fx, view.fy, *offset]) * PIXEL
