"""Rendering, off screen, of pinhole pictures of the scene, of depth pictures, and of masks of the
pixels that show some geoms.

Poses of cameras are in the vision frame (x right, y down, z forward), not in MuJoCo's camera frame
(x right, y up, looking along -z).
"""

import os
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera import gl
from sim.camera.camera import pinhole
from sim.geometry import VISION_FROM_MUJOCO
from sim.types import Array, Camera, DepthPicture, Image, Pose

ALONE = 5
"""A group of geoms that MuJoCo does not draw by default."""
TABLE = "table"
FLOOR = "floor"
TABLE_RIM = 0.01
"""A table is taken to be this much smaller on each side [m]: where its edge is nearly in the
picture, the sky is drawn."""
NEAREST = 0.05
"""A table nearer than this [m] may be cut away in front of the picture: the room's near plane is at
0.02 m."""
PIXEL = 1e-5
"""Size of a pixel on the sensor of a camera that is not centred [m]; any would do."""


def camera_pose(data: mujoco.MjData, camera: int) -> Pose:
    """Return the pose T_world_camera (camera frame: x right, y down, z forward) of a model's
    camera, by its id, as MuJoCo computed it last in `data`.
    """
    return Pose(
        data.cam_xmat[camera].reshape(3, 3) @ VISION_FROM_MUJOCO, data.cam_xpos[camera].copy()
    )


ELSEWHERE = (
    "This world was made in another process, and only that process can render it: make the world "
    'in the process that uses it; worker processes may be started with context="spawn".'
)


Promise = Callable[[], Image]
"""A function that waits for a picture that was begun, and returns it: RGB (H, W, 3)."""
DepthPromise = Callable[[], DepthPicture]
"""A function that waits for a depth picture that was begun, and returns it (H, W) [m]."""


class Renderer(Protocol):
    """Renders pinhole pictures of a MuJoCo scene for one camera. The simulation takes any class
    that has these methods, and calls `begin_depth` only if the camera has depth pictures.
    """

    def begin(self, data: mujoco.MjData) -> Promise:
        """Begin to render the scene in MuJoCo's state `data`, which may change afterwards; called
        once for each picture.

        Returns:
            Function that waits for the picture and returns it, a new RGB array (H, W, 3).
        """
        ...

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        """Return a mask (H, W), true where the picture of the scene shows one of the selected
        geoms; called when the visible fraction of the target is measured.

        Args:
            data: MuJoCo's state of the scene.
            geoms: Mask over the ids of all geoms (ngeom,), true for the selected ones.
            alone: Whether to draw the selected geoms only, so that no other geom hides them.
        """
        ...

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        """Begin to render the depths of the scene in MuJoCo's state `data`, which may change
        afterwards; called once for each depth picture.

        Returns:
            Function that waits for the distances along the optical axis (H, W) [m] and returns
            them; inf where no surface is seen.
        """
        ...

    def close(self) -> None:
        """Release the buffers that the renderer holds; called when the simulation ends."""


MakeRenderer = Callable[[mujoco.MjModel, str, Camera], Renderer]
"""Function that makes a renderer, given the scene's model, the name of a camera in it, and the
intrinsics of the pictures, which have no distortion."""


T = TypeVar("T")


class OpenGLRenderer:
    """MuJoCo's OpenGL renderer, off screen, for a camera of a model (by its name) with the
    intrinsics `view`, which are written into the model. It has the methods of the protocol
    `Renderer`.

    It holds OpenGL buffers until it is closed, and renders only in the process that made it: in
    another process the methods that render raise `NoRenderer`.

    Raises:
        NoRenderer: This machine has no OpenGL, MUJOCO_GL switches it off, or MuJoCo cannot render
            with it.
        ValueError: The model's camera is not a perspective one.
    """

    def __init__(self, model: mujoco.MjModel, camera: str, view: Camera) -> None:
        if pinhole(model, camera, view.width, view.height) != view:
            _aim(model, camera, view)
        offscreen = model.vis.global_
        offscreen.offwidth = view.width
        offscreen.offheight = view.height
        self._process = os.getpid()
        self._model = model
        self._sheets = [_Sheet(model), _Sheet(model)]
        fonts = mujoco.mjtFontScale.mjFONTSCALE_100.value
        try:
            self._context = gl.call(mujoco.MjrContext, model, fonts).result()
        except mujoco.FatalError as error:
            raise gl.NoRenderer(
                f"MuJoCo cannot render with the OpenGL of this machine ({gl.describe()}): {error}; "
                'set camera.renderer = "exact".'
            ) from None
        self._rect = mujoco.MjrRect(0, 0, view.width, view.height)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._option = mujoco.MjvOption()
        self._upside_down = np.empty((view.height, view.width, 3), np.uint8)
        self._backdrop = Backdrop(model, view)

    def close(self) -> None:
        if os.getpid() == self._process:  # elsewhere other buffers have these numbers
            self._process = 0  # they are freed once
            gl.call_later(self._context.free)

    def begin(self, data: mujoco.MjData) -> Promise:
        hidden = self._backdrop.is_hidden(data, self._camera.fixedcamid)
        floor = self._backdrop.floor if hidden else []
        group = self._model.geom_group[floor]
        self._model.geom_group[floor] = ALONE
        picture = self._draw(data, self._colours, sky=not hidden)
        self._model.geom_group[floor] = group
        return picture.result

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        group = self._model.geom_group.copy()
        shown = self._option.geomgroup.copy()
        if alone:
            self._model.geom_group[geoms & shown[group].astype(bool)] = ALONE
            self._option.geomgroup[:] = np.arange(len(shown)) == ALONE
        picture = self._draw(data, self._colours, segmented=True).result()
        self._model.geom_group[:] = group
        self._option.geomgroup[:] = shown
        scene = self._sheets[0].scene
        wanted = np.zeros(scene.ngeom + 1, bool)
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                wanted[geom.segid + 1] = geoms[geom.objid]
        return wanted[picture.astype(np.int64) @ (1, 1 << 8, 1 << 16)]

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        return self._draw(data, self._depths, segmented=True).result

    def _draw(
        self,
        data: mujoco.MjData,
        read: Callable[[], T],
        *,
        segmented: bool = False,
        sky: bool = True,
    ) -> Future[T]:
        """Begin a picture of the scene in the state `data`, which may change as soon as this
        returns. A segmented picture shows each geom in a colour of its own, without sky, shadows
        and anti-aliasing.

        Returns:
            Future of the result of `read`, a function that is called when the picture is drawn.

        Raises:
            NoRenderer: The renderer was made in another process.
        """
        if os.getpid() != self._process:
            raise gl.NoRenderer(ELSEWHERE)
        # One sheet may still be drawn while the other one is filled.
        self._sheets.reverse()
        sheet = self._sheets[0]
        sheet.picture.exception()  # waits
        sheet.scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = sky
        for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
            sheet.scene.flags[flag] = segmented
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._camera, every, sheet.scene
        )
        picture = gl.call(self._fill, sheet.scene, read)
        sheet.picture = picture
        return picture

    def _fill(self, scene: mujoco.MjvScene, read: Callable[[], T]) -> T:
        """Render a scene; return the result of `read`, which reads the picture."""
        # Worlds that are open at the same time share the context, and have their own buffers.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        mujoco.mjr_render(self._rect, scene, self._context)
        gl.finish()
        return read()

    def _colours(self) -> Image:
        mujoco.mjr_readPixels(self._upside_down, None, self._rect, self._context)
        return cv2.flip(self._upside_down, 0)  # type: ignore[return-value]

    def _depths(self) -> DepthPicture:
        """Return the depths (H, W) [m], inf where nothing is drawn, from OpenGL's depth buffer, in
        which 1 is the near plane, and 0 the far plane and all behind it.
        """
        upside_down = np.empty(self._upside_down.shape[:2], np.float32)
        # As OpenGL has it here: MuJoCo's other order would cost the digits of what is far.
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR.value
        mujoco.mjr_readPixels(None, upside_down, self._rect, self._context)
        buffer = np.flipud(upside_down)
        room = self._model.vis.map
        near, far = np.array([room.znear, room.zfar]) * self._model.stat.extent
        depth = 1 / (1 / far + buffer * (1 / near - 1 / far))
        return np.where(buffer > 0, depth, np.inf).astype(np.float32)


class _Sheet:
    """A MuJoCo scene (the list of what is drawn in a picture), and the future of the last picture
    drawn from it: the scene may be changed once that picture is done.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        self.picture: Future[Any] = Future()
        self.picture.set_result(None)


class Supersampled:
    """A renderer for a camera of a model (by its name) with the intrinsics `view` that averages
    blocks of `times` x `times` pixels: another renderer, which `make` makes, draws pictures that
    are `times` times as wide and high. Masks and depths are not averaged: each block gives its
    middle pixel (of an even number, the one right of and below the middle).
    """

    def __init__(
        self, make: MakeRenderer, times: int, model: mujoco.MjModel, camera: str, view: Camera
    ) -> None:
        """Make the other renderer, whose pictures are `times` times as wide and `times` times as
        high.
        """
        self._size = view.width, view.height
        self._middle = slice(times // 2, None, times)
        larger = Camera(
            fx=times * view.fx,
            fy=times * view.fy,
            cx=times * view.cx,
            cy=times * view.cy,
            width=times * view.width,
            height=times * view.height,
        )
        self._renderer = make(model, camera, larger)

    def begin(self, data: mujoco.MjData) -> Promise:
        picture = self._renderer.begin(data)
        return lambda: self._reduced(picture())

    def _reduced(self, picture: Image) -> Image:
        return cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)  # type: ignore[return-value]

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        return self._renderer.silhouette(data, geoms, alone=alone)[self._middle, self._middle]

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        picture = self._renderer.begin_depth(data)
        return lambda: picture()[self._middle, self._middle]

    def close(self) -> None:
        self._renderer.close()


class Unseen:
    """A renderer that draws nothing, for runs in which no component uses pictures: its pictures are
    black and as large as the intrinsics `view` say, its masks false and its depths inf.
    """

    def __init__(self, _model: mujoco.MjModel, _camera: str, view: Camera) -> None:
        self._picture: Image = np.zeros((view.height, view.width, 3), np.uint8)

    def begin(self, data: mujoco.MjData) -> Promise:
        return lambda: self._picture

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> NDArray[np.bool_]:
        return np.zeros(self._picture.shape[:2], bool)

    def begin_depth(self, data: mujoco.MjData) -> DepthPromise:
        return lambda: np.full(self._picture.shape[:2], np.inf, np.float32)

    def close(self) -> None:
        pass


class Backdrop:
    """Tells for each picture of a camera with the intrinsics `view` whether the scene's table fills
    it. Sky and floor then need not be drawn, which saves a third of the rendering time.
    """

    def __init__(self, model: mujoco.MjModel, view: Camera) -> None:
        """Find the table in a model; without a table nothing hides the sky."""
        found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, TABLE)
        self._reach = np.zeros(2) if found < 0 else model.geom_size[found, :2] - TABLE_RIM
        self.floor = np.array([i for i in range(model.ngeom) if model.geom(i).name == FLOOR], int)
        """Ids of the floor's geoms, which need not be drawn where the table fills the picture."""
        u = np.array([0.0, 0.0, view.width, view.width])
        v = np.array([0.0, view.height, 0.0, view.height])
        rays = [(u - view.cx) / view.fx, (view.cy - v) / view.fy, -np.ones(4)]
        self._corners = np.stack(rays)
        """The picture's corners (3, 4) in MuJoCo's camera frame, at depth 1 along the optical axis,
        a column each."""

    def is_hidden(self, data: mujoco.MjData, camera: int) -> bool:
        """Return whether the table hides sky and floor from a camera (by its id) in MuJoCo's state
        `data`. It does if the rays through the picture's four corners all meet the table more than
        1 cm from its edge, and at a depth of at least 5 cm along the optical axis.
        """
        eye = data.cam_xpos[camera]
        rays = data.cam_xmat[camera].reshape(3, 3) @ self._corners
        down = -rays[2]
        if down.min() <= 0 or eye[2] < NEAREST * down.max():
            return False
        ends = eye[:2, None] + eye[2] / down * rays[:2]
        return bool((np.abs(ends).max(axis=1) < self._reach).all())


def _aim(model: mujoco.MjModel, name: str, view: Camera) -> None:
    """Write the intrinsics of a pinhole camera into the camera of a MuJoCo model, by its name;
    `pinhole` reads them from there.
    """
    camera = model.camera(name).id
    size = np.array([view.width, view.height])
    offset = size / 2 - (view.cx, view.cy)
    model.cam_sensorsize[camera] = size * PIXEL
    model.cam_intrinsic[camera] = np.array([view.fx, view.fy, *offset]) * PIXEL
