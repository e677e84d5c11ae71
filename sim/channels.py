"""Channels: data that a component of a run may use besides the arguments of its methods.

The `Config` of a component (tracker, estimator, controller, ...) declares its channels: `needs =
frozenset({Channel.TRUTH})`. It receives them by its method `see(view)`, which is called before the
other methods that work on a picture; the `View` holds the declared channels only. The goal's
picture and the ego motion are given to controllers and trackers as arguments instead.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol, runtime_checkable

from sim.types import Array, DepthPicture, Frame, Image, Truth


class Channel(Enum):
    """Data that a component (tracker, law, estimator) may ask for; the value describes it."""

    PICTURE = "The picture of the camera."
    DEPTH = "The depth picture of the camera."
    GOAL_PICTURE = "The picture that the camera takes at the goal."
    EGO_MOTION = "The motion in the picture that the camera's own motion causes."
    TRUTH = "The exact pose of the target, which only a simulation knows."
    TRUE_MOTION = "The exact motion of the target, which only a simulation knows."
    SEEN = "Whether the target is seen in this picture."

    __hash__ = object.__hash__  # an enum's own, by name, is slow


Channels = frozenset[Channel]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Data of one picture for a component (tracker, estimator, controller); None stands for data
    that the component's settings do not declare in `needs`, or that are unknown.

    Besides the RGB picture (H, W, 3) and depths along the optical axis (H, W) [m] these are the
    target's exact state in the picture (`truth`), the rate (k,) [1/s] at which its own motion
    changes the k scaled features of the control law (`true_motion`, a mean over the time in which
    the next command acts), and whether the target is seen.
    """

    picture: Image | None = None
    """The picture, RGB (H, W, 3)."""
    depth: DepthPicture | None = None
    """Distance along the optical axis (H, W) [m]."""
    truth: Truth | None = None
    """Where the target is in this picture."""
    true_motion: Array | None = None
    """Mean de/dt (k,) of the target's own motion while the next command acts, divided by
    `FeatureSet.scales`."""
    seen: bool | None = None
    """Whether the target is seen; None too where the camera delivered no new picture."""

    @staticmethod
    def of(
        frame: Frame,
        needs: Channels,
        *,
        truth: Truth | None = None,
        true_motion: Array | None = None,
        seen: bool | None = None,
    ) -> "View":
        """Return a component's view of a frame: those data whose channels are in `needs`, and None
        for the others and for what is not given.
        """
        return View(
            picture=frame.image if Channel.PICTURE in needs else None,
            depth=frame.depth if Channel.DEPTH in needs else None,
            truth=truth if Channel.TRUTH in needs else None,
            true_motion=true_motion if Channel.TRUE_MOTION in needs else None,
            seen=seen if Channel.SEEN in needs else None,
        )


VIEWED = frozenset({Channel.TRUTH, Channel.TRUE_MOTION, Channel.SEEN})
"""Channels that reach a part by `see` alone."""


@runtime_checkable
class Sees(Protocol):
    """A component with a method `see`, which is given the data (channels) that the component's
    settings declare in `needs`, such as the target's true pose.
    """

    def see(self, view: View) -> None:
        """Receive the declared channels of the next picture, before any method that works on it."""


@runtime_checkable
class Declares(Protocol):
    """Settings of a component that declare, in `needs`, the channels that it uses."""

    @property
    def needs(self) -> Channels:
        """Channels of data that the component uses besides the arguments of its methods."""
        ...


def needs_of(config: object, usual: Channels = frozenset()) -> Channels:
    """Return the channels that a component's settings declare in `needs`; `usual` for settings that
    have no `needs`.
    """
    return config.needs if isinstance(config, Declares) else usual
