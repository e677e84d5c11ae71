"""A control law without a `Config`: a class with `start` and `command`, or a function; and a
policy: a class with `act`, or a function of three.

A law is called as law(seen, task) for each picture in which the target is seen, and returns the
twist (6,) or a `Command`; the camera stands still in the others. A policy is called as
act(picture, goal_picture, posture) for each picture. Arguments with a default are the settings.
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
"""The channels of a policy."""
PICTURES = 3
"""Arguments of a function that is a policy: picture, goal_picture, posture."""


def adapted(found: Any) -> type[Any] | None:
    """Return a `Config` class for a law or a policy of one's own; None for what is none."""
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
    """Return how many arguments have no default."""
    taken = inspect.signature(law).parameters.values()
    return sum(p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD for p in taken)


@final
class FunctionLaw:
    """A function as a controller."""

    def __init__(self, law: Law, settings: dict[str, Any]) -> None:
        """Take the function, and its arguments besides `seen` and `task`."""
        self._law = law
        self._settings = settings

    def start(self, task: Task) -> None:
        """Begin a task."""
        self._task = task

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return what the function asks for; without a target, no motion."""
        if seen is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        asked = self._law(
            seen, replace(self._task, goal=seen.goal or self._task.goal), **self._settings
        )
        return asked if isinstance(asked, Command) else Command(_floats(asked))


@final
class PolicyLaw:
    """A policy as a controller: it acts on every picture, whatever the tracker reports."""

    def __init__(self, act: Act, reset: Callable[[], object] | None = None) -> None:
        """Take the policy, and what makes it forget the run before, if it remembers anything.

        Args:
            act: Gives the twist (6,) of the camera, in its frame [m/s, rad/s], for a picture
                (H, W, 3), the picture of the goal (H, W, 3), and what the robot knows of itself.
            reset: Is called when a run begins.
        """
        self._act = act
        self._reset = reset

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: There is no picture of the goal.
        """
        if self._reset is not None:
            self._reset()
        if task.goal.picture is None:
            raise ValueError("there is no picture of the goal; give Loop.start one")
        self._goal = task.goal.picture.image

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return what the policy asks for; for a dropped frame, no motion."""
        if seen is None or seen.picture is None:
            return Command(np.zeros(6), mode=Mode.HOLDING)
        return Command(_floats(self._act(seen.picture.image, self._goal, posture)))


def _floats(twist: object) -> Array:
    """Return whole numbers and lists as floats; what is no real number stays, to be refused."""
    found = np.asarray(twist)
    return found if np.iscomplexobj(found) else np.asarray(twist, float)
