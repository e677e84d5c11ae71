"""Setting of a scene for a given time: positions of the bodies that no drive moves (target, board,
second target, leader), and lights.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial, reduce
from operator import or_
from typing import Protocol

import mujoco
import numpy as np

from sim.kinematics.robot import Robot
from sim.leader import Leader
from sim.models.assembly import LEADER, SECOND, SPOT, TARGET
from sim.models.quaternion import quaternion_of
from sim.mounting import CameraInHand
from sim.types import Effect, Pose

BOARD = "board"
LAMP = "lamp"
BOARD_NEARNESS = 0.3
"""Place at which the board crosses the line of sight, as a fraction of the way from target to
camera."""
BELOW = Pose(np.eye(3), np.array([0.0, 0.0, -100.0]))
"""Where a prop waits: deep enough for one of any height, and too far to be drawn."""


class Motion(Protocol):
    """The path of the target in the world frame, as a function of time alone.

    Any class with this method is a motion. `at` is called with any time of a run, and with negative
    times down to one frame interval before its start, in any order and repeatedly: it has to return
    the same pose for the same time, and may not keep state.

    >>> class Driver:
    ...     def at(self, time: float) -> Pose:
    ...         return Pose.planar(0.1 * time, 0.0, 0.0)
    >>> motion: Motion = Driver()
    >>> motion.at(2.0).translation.tolist()
    [0.2, 0.0, 0.0]
    """

    def at(self, time: float) -> Pose:
        """Return the target's pose T_world_target (x along the nose, z up; the table's top is z =
        0) at a time since the start of the run [s], which may be negative.
        """
        ...


class Disturbance(Protocol):
    """A change of light, of what the camera sees (a board, a second target) or of frame delivery,
    as a function of time alone; any class with `props` and `at` is a disturbance.

    `at` returns what the disturbance changes at a time of the run, and `Effect()` while it changes
    nothing; `props` names what it needs in the scene: "second_target", or "spot" (a spot light).
    Effects of several disturbances are combined by `|`. As with a motion, the same time has to give
    the same effect.

    >>> class Dusk:
    ...     props = ()
    ...     def at(self, time: float) -> Effect:
    ...         return Effect(lamp=0.5) if time > 1.0 else Effect()
    >>> disturbance: Disturbance = Dusk()
    >>> (disturbance.at(2.0) | Effect(gain=0.8)).lamp
    0.5
    """

    props: tuple[str, ...]
    """Props that it needs in the scene: "second_target", or "spot" for a finely lit table."""

    def at(self, time: float) -> Effect:
        """Return what the disturbance changes at a time since the start of the run [s]; `Effect()`
        if it changes nothing, as at every negative time. Called with any time of a run, in any
        order and repeatedly.
        """
        ...


class Stage:
    """Sets a scene for a given time: it places the bodies that follow a prescribed path (target,
    board, second target, leader) and sets the lights, as the motion and the disturbances say. The
    physics engine moves the robot.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        motion: Motion,
        disturbances: Sequence[Disturbance],
        robot: Robot,
        data: mujoco.MjData,
        leader: Leader | None = None,
    ) -> None:
        """Find the bodies and lights in a scene's model. Whether the motion or the robot moves the
        target follows from the robot's mounting; a target in the hand is placed by the hand's pose
        that MuJoCo computed last in `data`.
        """
        self._model = model
        self._at = lru_cache(maxsize=4)(motion.at)  # the last two frames' are asked for again
        self._mounting = robot.mounting
        self._hand = partial(robot.hand, data)
        self._leader = leader
        self._disturbances = tuple(disturbances)
        numbers = enumerate(model.body_mocapid.tolist())
        self._mocap = {model.body(body).name: number for body, number in numbers if number >= 0}
        self._lamp = model.light(LAMP).id
        self._spot = model.light(SPOT).id
        self._lamp_diffuse = model.light(LAMP).diffuse.copy()
        self._board_parked = model.body(BOARD).pos.copy()

    def effect(self, time: float) -> Effect:
        """Return the combined effect of all disturbances at a time since the start of the run
        [s].
        """
        return reduce(or_, (d.at(time) for d in self._disturbances), Effect())

    def target(self, time: float) -> Pose:
        """Return the target's pose T_world_target at a time since the start of the run [s]. If the
        robot holds the target, the time does not count: it is the present pose, as MuJoCo computed
        it last.
        """
        return self._mounting.target(self._at(time), self._hand)

    def goal(self, time: float) -> Pose | None:
        """Return the desired pose T_world_target of the target that the robot holds, at a time
        since the start of the run [s]; None if the scene has no leader (moving tag) beside which it
        is to be kept.
        """
        return None if self._leader is None else self._at(time) @ self._leader.T_moved_goal

    @property
    def follows_robot(self) -> bool:
        """True if what `place` sets may depend on the robot's present pose: if the robot holds the
        target, or if there are disturbances, as one may put a board before the camera.
        """
        return bool(self._disturbances) or not isinstance(self._mounting, CameraInHand)

    def place(self, data: mujoco.MjData, time: float, eye: Callable[[], Pose]) -> None:
        """Move target, leader, board and second target to where they are at a time of the run, and
        set the lights.

        Args:
            data: MuJoCo's state, whose mocap bodies are set; the lights are set in the model.
            time: Time since the start of the run [s].
            eye: Function that returns the camera's pose T_world_camera; it is called only if a
                board is to hide the target on the camera's line of sight.
        """
        target = self.target(time)
        self._put(data, TARGET, target)
        if self._leader is not None:
            self._put(data, LEADER, self._at(time) @ self._leader.T_moved_leader)
        if not self._disturbances:
            return
        effect = self.effect(time)
        board = Pose(np.eye(3), self._board_parked)
        if effect.board is not None:
            camera = eye()
            point = target.translation + BOARD_NEARNESS * (camera.translation - target.translation)
            across = camera.rotation @ np.array([effect.board, 0.0, 0.0])
            # Above the table it is level. A camera in the room may look from the side: across that.
            level = isinstance(self._mounting, CameraInHand)
            board = Pose(np.eye(3) if level else camera.rotation, point + across)
        self._put(data, BOARD, board)
        if SECOND in self._mocap:
            self._put(data, SECOND, effect.second or BELOW)
        model = self._model
        spot = effect.spot
        model.light_diffuse[self._lamp] = self._lamp_diffuse * effect.lamp
        model.light_active[self._spot] = spot is not None
        if spot is not None:
            model.light_pos[self._spot][:2] = spot.x, spot.y
            model.light_diffuse[self._spot] = spot.strength

    def _put(self, data: mujoco.MjData, body: str, pose: Pose) -> None:
        index = self._mocap[body]
        data.mocap_pos[index] = pose.translation
        data.mocap_quat[index] = quaternion_of(pose.rotation)
