"""The mounting of the camera: the robot carries the camera, or it carries the target in front of a
camera that stands in the room.

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
    """The robot carries the camera in its hand, the site `eye` (x right, y down, z forward), and
    the scenario's motion moves the target.
    """

    carried = "camera"
    """Name of what the robot carries, for messages."""
    sign = 1.0
    """The camera moves as the hand does."""
    standing = None
    """T_world_camera of a camera in the room: None, because the robot carries it."""

    def check(self, model: mujoco.MjModel, place: str) -> None:
        """Check that a robot's model can carry the camera.

        Raises:
            ValueError: The site `eye` is not where the camera is; `place` begins the message.
        """
        eye = model.site(CAMERA)
        camera = model.camera(CAMERA)
        same = np.allclose([*eye.pos, *eye.quat], [*camera.pos, *camera.quat], atol=1e-9)
        if eye.bodyid != camera.bodyid or not same:
            raise ValueError(
                f"{place}: the site '{EYE}' is not where the camera '{EYE}' is: give both the same "
                "body, position and orientation"
            )

    def check_start(self, eye: Pose) -> None:
        """Check a start pose T_world_camera.

        Raises:
            ValueError: The camera would not be above the table's top.
        """
        placement.check_above_table(eye)

    def eye(self, hand: Pose) -> Pose:
        """Return T_world_camera for a hand at T_world_hand: the same pose, because the camera is
        the hand.
        """
        return hand

    def hand(self, eye: Pose) -> Pose:
        """Return T_world_hand for a camera at T_world_camera: the same pose, because the camera is
        the hand.
        """
        return eye

    def target(self, moved: Pose, hand: Callable[[], Pose]) -> Pose:
        """Return `moved`, the pose T_world_target that the scenario's motion gives; `hand` is not
        used.
        """
        return moved

    def seen_from(self, target: Pose) -> Pose:
        """Return the target's pose in the frame in which camera poses are given, which is the
        world: `target` (T_world_target) unchanged.
        """
        return target

    def jacobian(self, J: Array, hand: Callable[[], Pose]) -> Array:
        """Return `J`, the Jacobian (6, n) of the hand's twist in the hand's frame, unchanged: it is
        that of the camera's twist in the camera frame. `hand` is not used.
        """
        return J

    def believed(self, model: mujoco.MjModel, T_camera_believed: Pose) -> "CameraInHand":
        """Return the mounting of a robot with a wrong hand-eye calibration, where T_camera_believed
        is the believed camera's pose in the true one; the site `eye` of `model` is moved there.
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
    """The robot carries the target in its hand, and the camera stands in the room; camera poses are
    relative to the target.
    """

    T_world_camera: Pose
    """Where the camera stands (x right, y down, z forward)."""
    T_hand_target: Pose
    """How the robot holds the target."""
    carried = "target"
    """Name of what the robot carries, for messages."""
    sign = -1.0
    """Seen from the target, the camera moves against the hand."""

    @property
    def standing(self) -> Pose:
        """Pose T_world_camera of the camera, which does not move."""
        return self.T_world_camera

    def check(self, model: mujoco.MjModel, place: str) -> None:
        """Accept every robot model, because its camera is moved into the room; the arguments are
        not used.
        """

    def check_start(self, eye: Pose) -> None:
        """Accept every start pose T_target_camera: a held target may be below the table's top."""

    def eye(self, hand: Pose) -> Pose:
        """Return T_target_camera, the pose of the standing camera as seen from the held target, for
        a hand at T_world_hand.
        """
        return (hand @ self.T_hand_target).inverse() @ self.T_world_camera

    def hand(self, eye: Pose) -> Pose:
        """Return T_world_hand for a camera at T_target_camera, as seen from the held target."""
        return self.T_world_camera @ eye.inverse() @ self.T_hand_target.inverse()

    def target(self, moved: Pose, hand: Callable[[], Pose]) -> Pose:
        """Return T_world_target of the held target, from the pose T_world_hand that the function
        `hand` returns; `moved` is not used.
        """
        return hand() @ self.T_hand_target

    def seen_from(self, target: Pose) -> Pose:
        """Return the target's pose in the frame in which camera poses are given, which is the held
        target's own: the identity. `target` (T_world_target) is not used.
        """
        return ON_TABLE

    def jacobian(self, J: Array, hand: Callable[[], Pose]) -> Array:
        """Return the Jacobian (6, n) of the camera's twist, relative to the target, in the camera
        frame: -V J, with J (6, n) that of the hand in the hand's frame, and V (6, 6) the conversion
        of twists from the hand's to the camera's frame.
        """
        return -adjoint(self.T_world_camera.inverse() @ hand()) @ J

    def believed(self, model: mujoco.MjModel, T_camera_believed: Pose) -> "TargetInHand":
        """Return the mounting of a robot that believes the camera at T_camera_believed relative to
        where it really stands; `model` is not used.
        """
        return replace(self, T_world_camera=self.T_world_camera @ T_camera_believed)


Mounting = CameraInHand | TargetInHand


def mounting_of(camera: CameraConfig) -> Mounting:
    """Return the mounting that the setting `camera.mounted` names: the camera in the hand, or the
    target in the hand.
    """
    if camera.mounted == "robot":
        return CameraInHand()
    return TargetInHand(mount_pose(camera.pose), mount_pose(camera.held))
