"""A camera that may be put anywhere in the scene of a simulated world, to draw the pictures that a
real one would have taken there.
"""

import copy

import mujoco

from servo.loop.episode import Episode
from sim.camera.camera import CameraConfig
from sim.camera.choice import renderer_of
from sim.camera.renderer import ALONE
from sim.geometry import VISION_FROM_MUJOCO
from sim.models.assembly import TARGET
from sim.models.quaternion import quaternion_of
from sim.mounting import CAMERA
from sim.types import Camera, Image, Pose

ROBOT = "robot/"
"""Beginning of the names of the robot's bodies, which are not drawn."""


class SceneCamera:
    """Draws pictures of an episode's scene from any pose, without the robot, by a camera `view`
    without distortion; call `close` after use.
    """

    def __init__(self, episode: Episode, view: Camera) -> None:
        """Take the scene of an episode without its robot, and a camera without distortion."""
        self._world = episode.world
        self._model = copy.copy(episode.world.model)
        is_robot = [self._model.body(k).name.startswith(ROBOT) for k in self._model.geom_bodyid]
        self._model.geom_group[is_robot] = ALONE
        self._model.geom_rgba[is_robot, 3] = 0.0
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = episode.world.data.qpos
        self._camera = self._model.camera(CAMERA).id
        self._target = int(self._model.body_mocapid[self._model.body(TARGET).id])
        self._renderer = renderer_of(CameraConfig())(self._model, CAMERA, view)

    def close(self) -> None:
        """Release the buffers of the renderer."""
        self._renderer.close()

    def picture(self, pose: Pose, time: float) -> Image:
        """Return the picture of the scene, RGB, uint8 (H, W, 3).

        Args:
            pose: Pose of the camera, T_world_camera [m].
            time: Time of the episode, at which the target is drawn [s].
        """
        target = self._world.target_at(time)
        self._data.mocap_pos[self._target] = target.translation
        self._data.mocap_quat[self._target] = quaternion_of(target.rotation)
        mujoco.mj_forward(self._model, self._data)
        self._data.cam_xpos[self._camera] = pose.translation
        self._data.cam_xmat[self._camera] = (pose.rotation @ VISION_FROM_MUJOCO.T).ravel()
        return self._renderer.begin(self._data)()
