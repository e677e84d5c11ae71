"""Pictures of the room, which is the MuJoCo scene seen from outside, with all bodies at the poses
of a step.
"""

from math import radians, tan

import mujoco
import numpy as np

from sim.camera.camera import CameraConfig
from sim.camera.choice import renderer_of
from sim.geometry import VISION_FROM_MUJOCO
from sim.models.assembly import with_stands
from sim.models.quaternion import matrix_of
from sim.types import Array, Camera, Image

CAMERA = "room"
"""Name of a camera of room.xml, which is moved."""
EYE = (0.9, -3.1, 1.9)
LOOKS_AT = (0.0, 0.0, 0.5)
"""First position of the camera in the world, and the point at which it looks then [m]; Rerun shows
recordings from there at first, too.
"""
SMOOTH = 4
"""Samples in each pixel, which are averaged so that edges have no steps."""
FOVY = radians(55)
"""Vertical field of view [rad], in which a whole robot fits."""
MARGIN = 1.1
"""Distance of the camera in `RoomView.fit`, over the least one from which all points are in the
picture."""


class RoomView:
    """Renderer of pictures, `width` by `height` [px], of a MuJoCo scene from outside, with all
    bodies at the poses of a step. Its camera has a vertical field of view of 55 deg.

    It holds OpenGL buffers: call `close` at the end. Steps have no poses of lights: lights are
    drawn with the values that the model has when this object is made.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        focal = height / 2 / tan(FOVY / 2)
        view = Camera(focal, focal, width / 2, height / 2, width, height)
        self._view = view
        model = self._model = with_stands(model)
        self._data = mujoco.MjData(model)
        self._id = model.camera(CAMERA).id
        before = model.vis.quality.offsamples
        model.vis.quality.offsamples = SMOOTH
        self._renderer = renderer_of(CameraConfig())(model, CAMERA, view)
        model.vis.quality.offsamples = before
        mujoco.mj_forward(model, self._data)
        self._eye: Array = np.array(EYE)
        self._looks_at: Array = np.array(LOOKS_AT)
        self._turned = np.stack([matrix_of(quaternion) for quaternion in model.geom_quat])

    def look(self, eye: Array, looks_at: Array) -> None:
        """Move the camera of this view to the point `eye` (3,), and turn it, upright, to the point
        `looks_at` (3,), both in the world [m].
        """
        self._eye = eye
        self._looks_at = looks_at

    def fit(self, points: Array) -> None:
        """Place the camera of this view so that all points (n, 3) [m, world] are inside the
        picture. It looks in its default direction at the middle of their bounding box, from 1.1
        times the least distance.
        """
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        back = np.subtract(EYE, LOOKS_AT)
        aside, up, nearer = ((points - middle) @ _towards(back, np.zeros(3))).T
        slope = tan(FOVY / 2)
        wide = slope * self._view.width / self._view.height
        distance = MARGIN * float(np.max(nearer + np.maximum(abs(aside) / wide, abs(up) / slope)))
        self.look(middle + distance * back / np.linalg.norm(back), middle)

    def render(self, bodies: Array) -> Image:
        """Return an RGB picture (H, W, 3) of the scene.

        Args:
            bodies: Poses (n, 3, 4) in the world of all n bodies of the model but the first, the
                world itself: rotation matrix and translation [m] of each, as in `World.bodies`.
        """
        model = self._model
        data = self._data
        data.xmat[1:] = bodies[:, :, :3].reshape(-1, 9)
        data.xpos[1:] = bodies[:, :, 3]
        turned = data.xmat[model.geom_bodyid].reshape(-1, 3, 3)
        data.geom_xmat[:] = (turned @ self._turned).reshape(-1, 9)
        data.geom_xpos[:] = data.xpos[model.geom_bodyid] + np.einsum(
            "gij,gj->gi", turned, model.geom_pos
        )
        mujoco.mj_camlight(model, data)
        data.cam_xpos[self._id] = self._eye
        data.cam_xmat[self._id] = _towards(self._eye, self._looks_at).ravel()
        return self._renderer.begin(data)()

    def close(self) -> None:
        """Release the OpenGL buffers."""
        self._renderer.close()

    def project(self, points: Array) -> Array:
        """Return the pixels (n, 2) [px] of points (n, 3) of the world [m] in the picture of this
        view; those of points behind its camera are meaningless.
        """
        seen = (points - self._eye) @ _towards(self._eye, self._looks_at) @ VISION_FROM_MUJOCO
        return self._view.project(seen)


def _towards(eye: Array, point: Array) -> Array:
    """Return the rotation (3, 3) from camera to world of an upright camera at `eye` (3,) that looks
    at a point (3,) along its -z axis, as MuJoCo's cameras do. Where it looks straight up or down,
    no direction is upright, and its right is the world's x axis.
    """
    back = np.subtract(eye, point) / np.linalg.norm(np.subtract(eye, point))
    right = np.cross([0.0, 0.0, 1.0], back)
    right = right / np.linalg.norm(right) if right.any() else np.array([1.0, 0.0, 0.0])
    return np.column_stack([right, np.cross(back, right), back])
