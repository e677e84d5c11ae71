"""The mounting of the camera: the robot carries the camera (eye in hand), or it carries the target
in front of a camera that stands in the room (eye to hand).

The kinematics of a camera in the hand hold for a target in the hand, too, if camera poses and
twists are taken relative to the target: moving the target by a twist moves the camera, seen from
the target, by the opposite twist.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import mujoco
import numpy as np

from sim import placement
from sim.camera.camera import CameraConfig
from sim.geometry import VISION_FROM_MUJOCO, adjoint, mount_pose
from sim.models.quaternion import matrix_of, quaternion_of
from sim.types import Array, Pose

EYE = "eye"
"""Name of the camera in a robot's model, and of the site in its optical centre."""
CAMERA = f"robot/{EYE}"
"""Their name in the scene."""
ON_TABLE = Pose.planar(0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, slots=True)
class CameraInHand:
    """The mounting in which the robot carries the camera: the camera is the robot's hand, the site
    `eye` (x right, y down, z forward), and the scenario's motion moves the target.
    """

    carried = "camera"
    """Name of what the robot carries, for messages."""
    sign = 1.0
    """The camera moves as the hand does."""
    standing = None
    """T_world_camera of a camera in the room: None, because the robot carries it."""

    def check(self, model: mujoco.MjModel, place: str) -> None:
        """Check that the robot in a scene's model can carry the camera: that its camera `eye` and
        its site `eye` have the same body and pose.

        Raises:
            ValueError: They differ; `place`, such as "the robot's model arm.xml", begins the
                message.
        """
        eye = model.site(CAMERA)
        camera = model.camera(CAMERA)
        # A quaternion and its negative are the same orientation.
        turned = min(np.linalg.norm(eye.quat - s * camera.quat) for s in (1, -1))
        same = np.allclose(eye.pos, camera.pos, atol=1e-9) and turned < 1e-8
        if eye.bodyid != camera.bodyid or not same:
            raise ValueError(
                f"{place}: the site '{EYE}' is not where the camera '{EYE}' is: give both the same "
                "body, position and orientation"
            )

    def check_start(self, eye: Pose) -> None:
        """Check the camera's pose T_world_camera at the start of a run.

        Raises:
            ValueError: The camera would not be above the table's top, z = 0.
        """
        placement.check_above_table(eye)

    def eye(self, hand: Pose) -> Pose:
        """Return the camera's pose T_world_camera, given the hand's pose T_world_hand: the same
        pose, because the camera is the hand.
        """
        return hand

    def hand(self, eye: Pose) -> Pose:
        """Return the hand's pose T_world_hand, given the camera's pose T_world_camera: the same
        pose, because the camera is the hand.
        """
        return eye

    def target(self, moved: Pose, hand: Callable[[], Pose]) -> Pose:
        """Return the target's pose T_world_target: `moved`, the pose that the scenario's motion
        gives. `hand` is not used.
        """
        return moved

    def seen_from(self, target: Pose) -> Pose:
        """Return the target's pose in the frame in which camera poses are given. With the camera in
        the hand this is the world, so it is `target` (T_world_target), unchanged.
        """
        return target

    def jacobian(self, J: Array, hand: Callable[[], Pose]) -> Array:
        """Return the Jacobian (6, n) from joint rates to the camera's twist in the camera frame:
        `J`, that of the hand's twist in the hand's frame, unchanged, because the camera is the
        hand. `hand` is not used.
        """
        return J

    def believed(self, model: mujoco.MjModel, T_camera_believed: Pose) -> "CameraInHand":
        """Return the mounting of a robot with a wrong hand-eye calibration: this mounting. The site
        `eye` of the robot's model `model` is moved, in place, to T_camera_believed, the pose of the
        believed camera in the true camera's frame.
        """
        site = model.site(CAMERA).id
        R = matrix_of(model.site_quat[site]) @ VISION_FROM_MUJOCO
        model.site_pos[site] += R @ T_camera_believed.translation
        model.site_quat[site] = quaternion_of(R @ T_camera_believed.rotation @ VISION_FROM_MUJOCO.T)
        model.site_sameframe[site] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        return self


@final
@dataclass(frozen=True, slots=True)
class TargetInHand:
    """The mounting in which the robot carries the target: the camera stands in the room at
    T_world_camera, and camera poses are given in the target's frame.
    """

    T_world_camera: Pose
    """Where the camera stands (x right, y down, z forward)."""
    T_hand_target: Pose
    """Pose of the held target in the hand's frame (x right, y down, z forward)."""
    carried = "target"
    """Name of what the robot carries, for messages."""
    sign = -1.0
    """Seen from the target, the camera moves against the hand."""

    @property
    def standing(self) -> Pose:
        """Pose T_world_camera of the camera (x right, y down, z forward), which does not move."""
        return self.T_world_camera

    def check(self, model: mujoco.MjModel, place: str) -> None:
        """Do nothing: every robot's model is accepted, because its camera is moved into the
        room.
        """

    def check_start(self, eye: Pose) -> None:
        """Do nothing: every start pose T_target_camera is accepted, also with the target below the
        table.
        """

    def eye(self, hand: Pose) -> Pose:
        """Return T_target_camera, the pose of the camera in the frame of the held target, given the
        hand's pose T_world_hand.
        """
        return (hand @ self.T_hand_target).inverse() @ self.T_world_camera

    def hand(self, eye: Pose) -> Pose:
        """Return the hand's pose T_world_hand with which the camera is at T_target_camera in the
        frame of the held target.
        """
        return self.T_world_camera @ eye.inverse() @ self.T_hand_target.inverse()

    def target(self, moved: Pose, hand: Callable[[], Pose]) -> Pose:
        """Return the pose T_world_target of the held target. The function `hand` returns the hand's
        pose T_world_hand; `moved` is not used.
        """
        return hand() @ self.T_hand_target

    def seen_from(self, target: Pose) -> Pose:
        """Return the target's pose in the frame in which camera poses are given. With the target in
        the hand this is the target's own frame, so it is the identity. `target` (T_world_target) is
        not used.
        """
        return ON_TABLE

    def jacobian(self, J: Array, hand: Callable[[], Pose]) -> Array:
        """Return the Jacobian (6, n) from joint rates to the camera's twist relative to the target,
        in the camera frame. It is -V J, where V (6, 6) converts twists from the hand's to the
        camera's frame.

        Args:
            J: The Jacobian (6, n) of the hand's twist in the hand's frame.
            hand: Function that returns the hand's pose T_world_hand.
        """
        return -adjoint(self.T_world_camera.inverse() @ hand()) @ J

    def believed(self, model: mujoco.MjModel, T_camera_believed: Pose) -> "TargetInHand":
        """Return the mounting of a robot that believes the camera to stand at the pose
        T_camera_believed in the true camera's frame; `model` is not used.
        """
        return replace(self, T_world_camera=self.T_world_camera @ T_camera_believed)


Mounting = CameraInHand | TargetInHand


def mounting_of(camera: CameraConfig) -> Mounting:
    """Return the mounting that a camera's settings name: `CameraInHand` if `mounted` is "robot",
    else `TargetInHand` with the settings' poses of the camera in the room and of the target in the
    hand.
    """
    if camera.mounted == "robot":
        return CameraInHand()
    return TargetInHand(mount_pose(camera.pose), mount_pose(camera.held))
