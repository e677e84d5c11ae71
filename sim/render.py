"""The camera: off-screen frames of the scene, with exposure, brightness and sensor noise.

Here MuJoCo's camera frame (x right, y up, looking along -z) becomes the vision frame (x right, y
down, z forward), and nowhere else.
"""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Annotated, Any

import cv2
import mujoco
import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from sim import gl
from sim.types import Array, Camera, Image, Pose

VISION_FROM_MUJOCO = np.diag([1.0, -1.0, -1.0])
ALONE = 5
"""A group of geoms that MuJoCo does not draw by itself."""
NOISE_MARGIN = 64
"""The noise tile is this much larger than the image [px], so that it can lie differently in each
frame.
"""


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """The camera of the robot."""

    width: Annotated[int, Ge(16), Le(2560)] = 320
    """Image width [px]."""
    height: Annotated[int, Ge(16), Le(1920)] = 240
    """Image height [px]."""
    rate: Annotated[float, Ge(0.5), Le(1000)] = 30.0
    """Frames a second [Hz]; the physics rate must be a whole multiple of it."""
    fovy_deg: Annotated[float, Gt(1), Lt(170)] = 45.0
    """Vertical field of view [deg]; a camera whose model has a sensor size keeps its intrinsics."""
    supersample: Annotated[int, Ge(1), Le(4)] = 1
    """Rendered this many times as large and averaged: 2 smooths the edges, and doubles the time."""
    noise: Annotated[float, Ge(0), Le(100)] = 0.0
    """Standard deviation of the sensor noise [grey levels of 255]."""
    exposure: Annotated[float, Ge(0), Le(1)] = 0.0
    """Exposure as a fraction of the frame interval; what moves meanwhile is blurred."""
    subframes: Annotated[int, Ge(2), Le(64)] = 6
    """Pictures that are averaged over the exposure, where there is one."""


def pinhole(model: mujoco.MjModel, name: str, width: int, height: int) -> Camera:
    """The intrinsics of a camera of the model, for an image of this size.

    A camera with a sensor size has focal length and principal point in metres on the sensor, which
    the image fills; all others have a vertical field of view, square pixels, and the principal
    point in the middle of the image.

    Raises:
        ValueError: The camera's projection is not perspective.
    """
    camera = model.camera(name).id
    if model.cam_projection[camera] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise ValueError(f"the camera '{name}' of the robot's model has to be a perspective one")
    sensor = model.cam_sensorsize[camera].astype(float)
    if not sensor.all():
        f = height / 2 / np.tan(np.radians(model.cam_fovy[camera]) / 2)
        return Camera(fx=f, fy=f, cx=width / 2, cy=height / 2, width=width, height=height)
    intrinsic = model.cam_intrinsic[camera].reshape(2, 2).astype(float)
    focal, offset = (intrinsic / sensor * (width, height)).tolist()
    # MuJoCo's offset says where the middle of the image lies as seen from the principal point.
    cx, cy = width / 2 - offset[0], height / 2 - offset[1]
    return Camera(fx=focal[0], fy=focal[1], cx=cx, cy=cy, width=width, height=height)


def camera_pose(data: mujoco.MjData, camera: int) -> Pose:
    """T_world_camera in the vision frame, as of the last kinematics."""
    return Pose(
        data.cam_xmat[camera].reshape(3, 3) @ VISION_FROM_MUJOCO, data.cam_xpos[camera].copy()
    )


class Renderer:
    """Renders one camera of one model into memory. Holds GL buffers: close it."""

    def __init__(
        self, model: mujoco.MjModel, camera: str, width: int, height: int, supersample: int = 1
    ) -> None:
        self._size = (width, height)
        width, height = width * supersample, height * supersample
        gl.make_current()
        self._model = model
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._option = mujoco.MjvOption()
        self._upside_down = np.empty((height, width, 3), np.uint8)

    def close(self) -> None:
        """Give the GL buffers back."""
        gl.make_current()
        self._context.free()

    def render(self, data: mujoco.MjData) -> Image:
        """A new RGB picture (H, W, 3) of the scene as it is."""
        self._draw(data)
        picture = cv2.flip(self._upside_down, 0)
        if picture.shape[1::-1] != self._size:
            picture = cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)
        return picture  # type: ignore[return-value]

    def silhouette(self, data: mujoco.MjData, geoms: Array, *, alone: bool) -> int:
        """Pixels in which one of the geoms (a mask over geom ids) is seen; alone: with nothing in
        front.
        """
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        group, shown = self._model.geom_group.copy(), self._option.geomgroup.copy()
        if alone:
            self._model.geom_group[geoms & shown[group].astype(bool)] = ALONE
            self._option.geomgroup[:] = np.arange(len(shown)) == ALONE
        self._draw(data)
        self._model.geom_group[:], self._option.geomgroup[:] = group, shown
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        wanted = np.zeros(self._scene.ngeom + 1, bool)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                wanted[geom.segid + 1] = geoms[geom.objid]
        codes = self._upside_down.astype(np.int64) @ (1, 1 << 8, 1 << 16)
        return int(wanted[codes].sum())

    def describe(self) -> str:
        """The name the OpenGL driver gives itself."""
        gl.make_current()
        opengl: Any = importlib.import_module("OpenGL.GL")
        names = (opengl.GL_RENDERER, opengl.GL_VERSION)
        return ", ".join(opengl.glGetString(name).decode() for name in names)

    def _draw(self, data: mujoco.MjData) -> None:
        gl.make_current()
        # Worlds that are open at the same time share the context, and draw into their own buffers.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._camera, every, self._scene
        )
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self._upside_down, None, self._rect, self._context)


class Sensor:
    """What happens between the light and the numbers: averaging over the exposure, brightness,
    noise.
    """

    def __init__(self, config: CameraConfig, rng: np.random.Generator) -> None:
        self._size = (config.height, config.width)
        self._rng = rng
        self._noise = None
        if config.noise > 0:
            tile = (config.height + NOISE_MARGIN, config.width + NOISE_MARGIN, 3)
            self._noise = rng.normal(0.0, config.noise, tile).astype(np.float32)

    def develop(self, pictures: list[Image], gain: float) -> Image:
        """The read-only frame from the pictures (H, W, 3) taken over one exposure."""
        if len(pictures) == 1 and gain == 1.0 and self._noise is None:
            image = pictures[0]
        else:
            light = np.mean(pictures, axis=0, dtype=np.float32) * np.float32(gain)
            if self._noise is not None:
                top, left = self._rng.integers(0, NOISE_MARGIN, 2)
                light += self._noise[top : top + self._size[0], left : left + self._size[1]]
            image = np.clip(np.rint(light), 0, 255).astype(np.uint8)
        image.setflags(write=False)
        return image
