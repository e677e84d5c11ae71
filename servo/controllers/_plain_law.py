"""Adapters of control laws and policies that users write without a `Config`.

A law is a class with `start` and `command`, or a function law(seen, task) that is called for each
picture in which the target is seen and returns the twist (6,) or a `Command`; without a target the
camera stands still. A policy is a class with a method, or a function, act(picture, goal_picture,
posture), which is called for each picture and returns the twist (6,). A policy act(picture,
goal_picture, camera, posture) or act(picture, goal_picture, camera, posture, depth) gets also the
believed intrinsics and the depth at the goal, and its posture is relative to the first picture.
Arguments with a default value are settings of the scenario.
"""

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, final

import numpy as np

from servo.parts import Task
from servo.types import CameraImage, Command, Mode, Prediction, Sight, Trace
from sim.channels import Channel
from sim.plain_part import config_for, has_methods, plain_config
from sim.types import Array, Image, Posture

Law = Callable[..., Array | Command]
Act = Callable[..., Array]
"""A policy's function: of picture, goal_picture, posture; or of picture, goal_picture, camera,
posture and perhaps depth."""
SEES_PICTURES = frozenset({Channel.PICTURE, Channel.GOAL_PICTURE})
"""Channels that a policy needs."""
OF_POLICIES = (3, 4, 5)
"""Numbers of arguments without a default value that a policy may have."""


def adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a user's control law or policy, so that a scenario can name it;
    None for an object that is neither.
    """
    if has_methods(found, "command"):
        return plain_config(found, "command")
    if has_methods(found, "act"):
        make = found if isinstance(found, type) else lambda: found
        return config_for(found, lambda **given: _of_object(make(**given)), needs=SEES_PICTURES)
    if not inspect.isfunction(found):
        return None
    if _asks_for(found) in OF_POLICIES:
        return config_for(
            found, lambda **given: PolicyLaw(partial(found, **given)), needs=SEES_PICTURES
        )
    return config_for(found, lambda **given: FunctionLaw(found, given))


def _of_object(policy: Any) -> "PolicyLaw":
    return PolicyLaw(policy.act, getattr(policy, "reset", None))


def _asks_for(law: Callable[..., Any]) -> int:
    """Return the number of arguments without a default value that a function takes by position."""
    taken = inspect.signature(law).parameters.values()
    by_position = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.default is p.empty and p.kind in by_position for p in taken)


@final
class FunctionLaw:
    """Controller whose commands a user's function law(seen, task) returns."""

    def __init__(self, law: Law, settings: dict[str, Any]) -> None:
        """Store the function, and the values of its settings, the arguments other than `seen` and
        `task`.
        """
        self._law = law
        self._settings = settings

    def start(self, task: Task) -> None:
        """Begin a run with a task, which the function is given for each picture, with the goal of
        that picture.
        """
        self._task = task

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return what the function returns; for a twist, a `Command` with the measured features
        and their errors as its trace. If the target is not seen, the twist is zero, without a
        trace. `posture` and `dt` are not used.
        """
        if seen is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        task = replace(self._task, goal=seen.goal or self._task.goal)
        asked = self._law(seen, task, **self._settings)
        if isinstance(asked, Command):
            return asked
        return Command(_floats(asked), trace=_measured(seen, task))


def _measured(seen: Sight, task: Task) -> Trace:
    """Return the features of the target and their errors, without a prediction."""
    values, goal = map(task.features.values, (seen, task.goal))
    error = task.features.error(values, goal)
    unknown = np.full(len(values), np.nan)
    prediction = Prediction.unmeasured(error, unknown)
    return Trace(values, error, prediction, task.features.scales(goal), unknown)


@final
class PolicyLaw:
    """Controller that calls a policy with the camera's picture, the goal's picture, the robot's
    posture and perhaps camera and depth, whether the tracker sees the target or not.
    """

    def __init__(self, act: Act, reset: Callable[[], object] | None = None) -> None:
        """Store the policy.

        Args:
            act: Function that returns the camera twist (6,) in the camera frame [m/s, rad/s] from
                three arguments: the camera's picture (H, W, 3), the goal's picture (H, W, 3), and
                the robot's posture. With four, the third is the believed `Camera`, and the posture
                is relative to the first picture (`since`); a fifth is the believed depth at the
                goal, on the optical axis [m].
            reset: Function that makes the policy forget the run before; it is called when a run
                begins.
        """
        self._act = act
        self._reset = reset
        self._takes = _asks_for(act)

    @property
    def starts_at_zero(self) -> bool:
        """Whether the posture that the policy gets is relative to the first picture."""
        return self._takes > OF_POLICIES[0]

    def start(self, task: Task) -> None:
        """Begin a run with the goal's picture and depth of a task.

        Raises:
            ValueError: The task has no picture of the goal.
        """
        if task.goal.picture is None:
            raise ValueError("there is no picture of the goal: give it to Loop.start as `goal`")
        self.begin(task.goal.picture, 1.0 / task.goal.plane.C)

    def begin(self, goal: CameraImage, depth: float) -> None:
        """Begin a run with the goal's picture and the believed depth there, on the optical axis
        [m].
        """
        if self._reset is not None:
            self._reset()
        self._goal = goal
        self._depth = depth
        self._first: Posture | None = None

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the policy's twist as a `Command`; a twist of zero for a frame without a picture.
        `dt` is not used.
        """
        if seen is None or seen.picture is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        if self.starts_at_zero:
            self._first = self._first or posture
            posture = since(self._first, posture)
        return Command(_floats(self.twist(seen.picture.image, posture)))

    def twist(self, picture: Image, posture: Posture) -> Array:
        """Return what the policy returns for a picture (H, W, 3): the camera twist (6,) in the
        camera frame [m/s, rad/s].

        Args:
            picture: The camera's RGB picture (H, W, 3) of uint8.
            posture: State of the robot, which the policy gets unchanged: for a policy with more
                than three arguments it has to be relative to the first picture (`since`) already.
        """
        given: list[object] = [picture, self._goal.image, posture]
        if self._takes > len(given):
            given[2:] = [self._goal.camera, posture, self._depth]
        return self._act(*given[: max(self._takes, OF_POLICIES[0])])


def since(first: Posture, now: Posture) -> Posture:
    """Return a posture relative to an earlier one: `T_base_camera` is the pose in the frame of the
    earlier camera, joints and their limits are counted from the earlier joints, so that pose and
    joints do not tell where in the room the robot is. Twists, limits of rates and Jacobian stay.
    """
    return replace(
        now,
        T_base_camera=first.T_base_camera.inverse() @ now.T_base_camera,
        joints=now.joints - first.joints,
        lower=now.lower - first.joints,
        upper=now.upper - first.joints,
    )


def _floats(twist: object) -> Array:
    """Return a twist as an array of floats; one of complex numbers is returned unchanged, and the
    contract check refuses it later.
    """
    found = np.asarray(twist)
    return found if np.iscomplexobj(found) else np.asarray(twist, float)
