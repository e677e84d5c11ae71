"""Channels: data that a component of a run may use besides the arguments of its methods.

The `Config` of a component (tracker, estimator, controller, ...) declares its channels: `needs =
frozenset({Channel.TRUTH})`. The component receives their data by its method `see(view)`, which is
called before its other methods that work on a picture; the `View` holds the declared channels only.
The goal's picture and the ego motion are not in it: feature sets and controllers find the goal's
picture in the `Sight` that they are given, and a tracker gets the ego motion as an argument of
`update`. `given_to` says which channels the components of a section can declare.
"""

from collections.abc import Set
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeGuard, cast, runtime_checkable

from sim.types import Array, DepthPicture, Frame, Image, Truth


class Channel(Enum):
    """Data that a component (tracker, feature set, estimator, controller) of a run may ask for,
    besides the arguments of its methods; a member's value describes the data.
    """

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
    """Data of one picture that a component (tracker, feature set, estimator, controller) may use. A
    field is None if the component's settings do not declare the field's channel in `needs`, or if
    the value is unknown.

    The fields are the RGB picture (H, W, 3); depths along the optical axis (H, W) [m]; the target's
    exact pose and projection (`truth`); the rate of change (k,) [1/s] of the k features of visual
    servoing, divided by `FeatureSet.scales`, that the target's own motion causes while the next
    command acts (`true_motion`, a mean over this time); and whether the target is seen.
    """

    picture: Image | None = None
    """The picture, RGB (H, W, 3)."""
    depth: DepthPicture | None = None
    """Distance along the optical axis (H, W) [m]."""
    truth: Truth | None = None
    """The target's exact pose at the time of this picture, and its projection into the picture."""
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
        """Return a component's view of a frame: the data whose channels are in `needs`. All other
        fields, and those that are not given, are None.
        """
        return View(
            picture=frame.image if Channel.PICTURE in needs else None,
            depth=frame.depth if Channel.DEPTH in needs else None,
            truth=truth if Channel.TRUTH in needs else None,
            true_motion=true_motion if Channel.TRUE_MOTION in needs else None,
            seen=seen if Channel.SEEN in needs else None,
        )


BY_ARGUMENTS = {
    "tracker": frozenset({Channel.PICTURE, Channel.DEPTH, Channel.EGO_MOTION}),
    "features": frozenset({Channel.PICTURE, Channel.GOAL_PICTURE}),
    "estimator": frozenset[Channel](),
    "controller": frozenset({Channel.PICTURE, Channel.GOAL_PICTURE}),
}
"""The channels that reach a component by the arguments of its methods, by the name of its section
in a scenario."""
VIEWED = frozenset({Channel.PICTURE, Channel.DEPTH, Channel.TRUTH})
"""The channels that reach each of these components by `see`."""
OF_THE_LAW = frozenset({Channel.TRUE_MOTION, Channel.SEEN})
"""The channels that reach features, estimator and controller by `see`, but not a tracker."""


@runtime_checkable
class Sees(Protocol):
    """A component (tracker, feature set, estimator, controller) that wants data besides the
    arguments of its methods, such as the target's true pose. Its settings declare the data
    (channels) in `needs`; its method `see` receives them.
    """

    def see(self, view: View) -> None:
        """Receive the data that the component's settings declare in `needs`; called once for each
        picture (of a tracker: for each new one), before the component's other methods that work on
        this picture.
        """


@runtime_checkable
class Declares(Protocol):
    """Settings of a component (tracker, feature set, estimator, controller) that declare, in
    `needs`, which data the component uses besides the arguments of its methods.
    """

    @property
    def needs(self) -> Channels:
        """Channels (kinds of data, such as the depth picture) that the component uses besides the
        arguments of its methods.
        """
        ...


def needs_of(config: object, usual: Channels = frozenset()) -> Channels:
    """Return the channels (kinds of data, such as the depth picture) that a component's settings
    declare in `needs`; if they have no `needs`, return `usual`.
    """
    return config.needs if isinstance(config, Declares) else usual


def given_to(place: str) -> Channels:
    """Return the channels that components of a section, such as "tracker", can be given."""
    viewed = VIEWED if place == "tracker" else VIEWED | OF_THE_LAW
    return BY_ARGUMENTS[place] | viewed


def channels_fault(place: str, config: object) -> str:
    """Return, as a clause for a message, what is wrong with the channels that a component declares
    in the `needs` of its settings: they are no set of channels, or components of this section
    cannot get one of them. Return "" if nothing is wrong.

    Args:
        place: Name of the component's section in a scenario, a key of `BY_ARGUMENTS`.
        config: The component's settings.
    """
    needs = needs_of(config)
    if not _is_channels(needs):
        return (
            f"needs of its Config is {needs!r}, which is no set of servo.Channel members: give a "
            "frozenset of these"
        )
    known = given_to(place)
    unknown = needs - known
    if unknown:
        return (
            f"its Config needs {_names(unknown)}, which the {place} is not given; it can have "
            f"{_names(known)}"
        )
    return ""


def _is_channels(value: object) -> TypeGuard[Channels]:
    return isinstance(value, Set) and all(
        isinstance(one, Channel) for one in cast(Set[object], value)
    )


def _names(channels: Channels) -> str:
    return ", ".join(sorted(channel.name for channel in channels))
