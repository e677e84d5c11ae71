"""Control laws and policies without a `Config`.

A law is a class with `start` and `command`, or a function law(seen, task) that is called for each
picture in which the target is seen and returns the twist (6,) or a `Command`; without a target the
camera stands still. A policy is a class with a method, or a function, act(picture, goal_picture,
posture) that is called for each picture. Arguments with a default value are settings.
"""

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, final

import numpy as np

from servo.parts import Task
from servo.types import Command, Mode, Sight
from sim.channels import Channel
from sim.plain_part import config_for, has_methods, plain_config
from sim.types import Array, Image, Posture

Law = Callable[..., Array | Command]
Act = Callable[[Image, Image, Posture], Array]
SEES_PICTURES = frozenset({Channel.PICTURE, Channel.GOAL_PICTURE})
"""Channels that a policy needs."""
PICTURES = 3
"""Number of arguments of a policy: picture, goal_picture, posture."""


def adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a user's law or policy; None for any other object."""
    if has_methods(found, "command"):
        return plain_config(found, "command")
    if has_methods(found, "act"):
        make = found if isinstance(found, type) else lambda: found
        return config_for(found, lambda **given: _of_object(make(**given)), needs=SEES_PICTURES)
    if not inspect.isfunction(found):
        return None
    if _asks_for(found) == PICTURES:
        return config_for(
            found, lambda **given: PolicyLaw(partial(found, **given)), needs=SEES_PICTURES
        )
    return config_for(found, lambda **given: FunctionLaw(found, given))


def _of_object(policy: Any) -> "PolicyLaw":
    return PolicyLaw(policy.act, getattr(policy, "reset", None))


def _asks_for(law: Callable[..., Any]) -> int:
    """Return how many arguments without default values a function takes."""
    taken = inspect.signature(law).parameters.values()
    return sum(p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD for p in taken)


@final
class FunctionLaw:
    """A controller whose commands a user's function law(seen, task) returns."""

    def __init__(self, law: Law, settings: dict[str, Any]) -> None:
        """Store the function, and the values of its arguments other than `seen` and `task`."""
        self._law = law
        self._settings = settings

    def start(self, task: Task) -> None:
        """Begin a run."""
        self._task = task

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the command of the function; a twist of zero if the target is not seen."""
        if seen is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        asked = self._law(
            seen, replace(self._task, goal=seen.goal or self._task.goal), **self._settings
        )
        return asked if isinstance(asked, Command) else Command(_floats(asked))


@final
class PolicyLaw:
    """A controller that calls a policy for each picture, whatever the tracker reports."""

    def __init__(self, act: Act, reset: Callable[[], object] | None = None) -> None:
        """Store the policy.

        Args:
            act: Returns the camera twist (6,) in the camera frame [m/s, rad/s] from a picture
                (H, W, 3), the goal's picture (H, W, 3), and the robot's posture.
            reset: Called when a run begins, so that the policy forgets the one before.
        """
        self._act = act
        self._reset = reset

    def start(self, task: Task) -> None:
        """Begin a run.

        Raises:
            ValueError: There is no picture of the goal.
        """
        if self._reset is not None:
            self._reset()
        if task.goal.picture is None:
            raise ValueError("there is no picture of the goal; give Loop.start one")
        self._goal = task.goal.picture.image

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the command of the policy; a twist of zero for a dropped frame."""
        if seen is None or seen.picture is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        return Command(_floats(self._act(seen.picture.image, self._goal, posture)))


def _floats(twist: object) -> Array:
    """Return a twist as floats; complex numbers stay as they are, and are refused later."""
    found = np.asarray(twist)
    return found if np.iscomplexobj(found) else np.asarray(twist, float)
