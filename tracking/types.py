"""State, region, estimate and status of a tracked target; the protocol of a tracker, its traits,
and checks of its arguments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from numbers import Real
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np

from sim.channels import Channel, needs_of
from sim.types import LARGEST_PICTURE, Array, Frame

LARGEST_LOG = 5.0
"""Largest absolute value of ln scale: a target grows or shrinks by at most a factor of 148."""
ROUNDING = 1e-6
"""An outline still counts as convex if a corner is dented by about this share of its area: single
precision rounds by so much."""


class _SetByStart:
    """Default of an attribute that `Tracker.start` replaces; reading it before `start` raises a
    ValueError.
    """

    def __get__(self, tracker: object | None, owner: type) -> Any:
        if tracker is None:
            return self
        raise ValueError(f"{owner.__name__}: call start(frame, region, state) before update(frame)")


SET_BY_START: Any = _SetByStart()
"""Class attribute of a tracker that `start` replaces; reading it earlier raises a ValueError."""


@dataclass(frozen=True, slots=True)
class State:
    """State of the target in one picture: its centre x (to the right) and y (down) from the image's
    top left corner [px]; its orientation theta, from +x towards +y [rad]; and its size over its
    size in the first picture, `scale` (Teuliere, Marchand, Eck, section II).
    """

    x: float
    """Centre, to the right [px]."""
    y: float
    """Centre, down [px]."""
    theta: float = 0.0
    """Orientation, from +x towards +y [rad]; continuous, so it may exceed pi."""
    scale: float = 1.0
    """Size relative to the first frame."""

    @property
    def vector(self) -> Array:
        """Vector (4,) of x, y [px], theta [rad] and ln scale, as filters and searches use it."""
        return np.array([self.x, self.y, self.theta, math.log(self.scale)])

    def moved(self, change: Array | None) -> State:
        """Return this state plus a change (4,) of x, y [px], theta [rad] and ln scale, with ln
        scale clipped to -5..5; for None return the state itself.
        """
        return self if change is None else State.of(self.vector + change)

    @staticmethod
    def of(vector: Array) -> State:
        """Return the state of a vector (4,) of x, y [px], theta [rad] and ln scale, which is
        clipped to -5..5.
        """
        x, y, theta, log_scale = vector.tolist()
        return State(x, y, theta, math.exp(min(max(log_scale, -LARGEST_LOG), LARGEST_LOG)))


CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners of a rectangle over half its sides, clockwise in the image from the top left one on."""


@dataclass(frozen=True, slots=True)
class Region:
    """Width and height [px] of the rectangle around the target in the first picture, and the
    target's four corners (4, 2) [px] there (`quad`), None where they are not known. A `State` says
    where this rectangle is in any picture: its centre, angle and scale.
    """

    width: float
    """Side along the target's own x axis [px]."""
    height: float
    """Side along the target's own y axis [px]."""
    quad: Array | None = field(default=None, compare=False)
    """The target's four corners (4, 2) in the first picture [px] where they are known: a rectangle
    that is seen tilted has no right angles."""

    def corners(self, state: State) -> Array:
        """Return the rectangle's corners (4, 2) in the image [px]: clockwise, at theta = 0 from the
        top left one on.
        """
        half = state.scale / 2 * np.array([self.width, self.height])
        c = np.cos(state.theta)
        s = np.sin(state.theta)
        box = half * CORNERS
        return box @ np.array([[c, s], [-s, c]]) + (state.x, state.y)

    def first_corners(self, state: State) -> Array:
        """Return the target's corners (4, 2) in the first picture [px], clockwise: `quad` if it is
        known, else the corners of the rectangle at `state`, the target's state in that picture.
        """
        return self.corners(state) if self.quad is None else self.quad

    def inner(self, inset: float) -> Region:
        """Return a region with the same centre whose width and height are shorter by the share
        `inset`, 0..1, half of it on each side; its `quad` is None.
        """
        return Region(self.width * (1 - inset), self.height * (1 - inset))

    def area(self, state: State) -> float:
        """Return the area of the region in the image at a state [px^2]."""
        return self.width * self.height * state.scale**2


def turns_of(corners: Array) -> Array:
    """Return the cross products (n,) [px^2] of each side of an outline (n, 2) [px] with the next
    side: above 0 where the outline turns clockwise in the image.
    """
    sides = np.diff(corners, axis=0, append=corners[:1])
    after = np.roll(sides, -1, axis=0)
    return sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]


def goes_around(corners: Array) -> bool:
    """Return True if corners (4, 2) [px] form a convex outline that runs clockwise in the image, as
    the corners of a rectangle do that is seen from its front. Three of them may lie on one line.
    """
    turns = turns_of(corners)
    return bool(turns.sum() > 0 and turns.min() >= -ROUNDING * turns.sum())


class Status(Enum):
    """Whether a tracker sees its target in a frame (LOCKED, UNSURE or LOST); the value of each
    member explains it.
    """

    LOCKED = "The target is seen and followed."
    UNSURE = (
        "The target's appearance has changed, perhaps it is hidden: the estimate is a prediction."
    )
    LOST = "The target has not been seen for a while; the estimate means nothing."


@dataclass(frozen=True, slots=True)
class Estimate:
    """Result of a tracker for one frame: state in the image; its covariance (4, 4) in x, y [px],
    theta [rad] and ln scale, nan where unknown; distance from the target's appearance, 0..1;
    status; whether angle and size are followed; and corners (4, 2) [px], None if the tracker finds
    none.

    `evaluations` is the number of histograms computed. A particle filter adds its particles (N, 5),
    x, y [px], theta [rad], scale and weight, and their effective sample size `ess`. `likely_scale`
    is the scale that a control loop uses if it rejects that of `state`, else None.
    """

    state: State
    """Position [px], angle [rad] and scale of the target in the image."""
    covariance: Array
    """Covariance (4, 4) of x, y [px], theta [rad], ln scale; nan where the tracker has none."""
    distance: float
    """Distance of the picture here from the target's appearance, from 0 (alike) to 1: Bhattacharyya
    distance of histograms, or 1 - a measure of the tracker's own (correlation, confidence, score),
    or 0 where the target is seen and 1 where it is not."""
    status: Status
    """Whether the target is seen."""
    follows: tuple[bool, bool] = (True, True)
    """Whether the tracker follows the angle, and whether it follows the size. What it does not
    follow keeps its first value, or is changed only by what the camera's motion (`ego`) causes."""
    ess: float = float("nan")
    """Effective sample size of a particle filter; nan for other trackers."""
    evaluations: int = 0
    """Number of histograms that the tracker computed for this frame."""
    particles: Array | None = None
    """Particles (N, 5): x, y [px], theta [rad], scale, weight; weights sum to 1."""
    corners: Array | None = None
    """Corners (4, 2) of the target [px] in the order of `Region.corners`, from a tracker that
    follows perspective; None: the region's corners at `state`."""
    likely_scale: float | None = None
    """Set by the loop where it refuses the size of `state`, because camera and target cannot have
    moved that much: the scale that it uses instead, by the camera's motion."""

    def outline(self, region: Region) -> Array:
        """Return the target's corners (4, 2) in the image [px], in the order of `Region.corners`:
        `corners`, if the tracker reports them, else those of a region at `state`.
        """
        return region.corners(self.state) if self.corners is None else self.corners


def unknown_covariance() -> Array:
    """Return a covariance (4, 4) of nan, for trackers that estimate none."""
    return np.full((4, 4), np.nan)


class Tracker(Protocol):
    """Protocol of all trackers: a method that follows one target through the frames of a sequence.

    `start` is called once with the first frame, then `update` once for each further frame in order.
    A tracker keeps its state between calls and copies the pixels that it needs later (the caller
    may reuse the buffer). It returns an estimate for every frame: a target that it does not see is
    reported by the status, not by an exception.

    >>> class Fixed:
    ...     def start(self, frame: Frame, region: Region, state: State) -> None:
    ...         self.state = state
    ...     def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
    ...         return Estimate(self.state, unknown_covariance(), 0.0, Status.LOCKED)
    >>> tracker: Tracker = Fixed()
    >>> picture = Frame(np.zeros((48, 64, 3), np.uint8), time=0.0, index=0)
    >>> tracker.start(picture, Region(20.0, 10.0), State(32.0, 24.0))
    >>> tracker.update(picture).state.x
    32.0
    """

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's appearance from the first frame; called once, before `update`.

        Args:
            frame: The first frame.
            region: Size of the target's rectangle in that frame [px].
            state: Centre [px], angle [rad] and scale of the rectangle in that frame.

        Raises:
            ValueError: The region or the picture is unusable.
        """

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate of the target in the next frame; called for each frame after the
        first, in order.

        Args:
            frame: The next frame.
            ego: Change (4,) of x, y [px], theta [rad] and ln scale by which the camera's motion
                since the last frame has moved a target that stood still; None where it is unknown.
        """
        ...


class Trait(Enum):
    """Property of a tracker by which users choose and list trackers, such as that it follows the
    angle; each member's value is a sentence that describes it.
    """

    COLOUR = "It recognises the target by its colours."
    TEXTURE = "It recognises the target by its texture."
    ANGLE = "It follows the angle of a target that shows one."
    CORNERS = "It reports the four corners of the target, and with them its tilt."
    MARKER = "It follows markers of its own, and no other target."
    FOREIGN = "It runs a program or a model that the user names."


Traits = frozenset[Trait]
SEES_PICTURES = frozenset({Channel.PICTURE, Channel.EGO_MOTION})
"""Input of a tracker whose settings declare none: pictures and the camera's motion."""


@runtime_checkable
class Describes(Protocol):
    """Protocol of a tracker's settings (a `Config`) that declare the traits, such as "reports
    corners", of the tracker that they build.
    """

    @property
    def traits(self) -> Traits:
        """Properties (`Trait`) of the tracker that these settings build; an empty set: none."""
        ...


def traits_of(config: object) -> Traits | None:
    """Return the set of properties (`Trait`) that a tracker's settings, a `Config`, declare in
    their attribute `traits`; None if they have no such attribute.
    """
    return config.traits if isinstance(config, Describes) else None


def follows_any_target(config: object) -> bool:
    """Return True if the tracker that a `Config` builds can be used on any target: it follows no
    markers of its own, and takes no input but pictures and the camera's motion (not the true poses,
    for instance). Settings that declare neither traits nor inputs give True.
    """
    marked = Trait.MARKER in (traits_of(config) or ())
    return not marked and needs_of(config, SEES_PICTURES) <= SEES_PICTURES


@runtime_checkable
class SeesOutline(Protocol):
    """Protocol of a tracker that can correct the region which the user gave in the first picture,
    because it knows the shape of its target, such as a tag. `outline` is called before `start`.
    """

    def outline(self, frame: Frame, region: Region, state: State) -> tuple[Region, State]:
        """Return the region [px] of the target that is seen in the first frame, and its state
        there.

        Args:
            frame: The first frame.
            region: Size of the target's rectangle that the user gave [px].
            state: Centre [px] and angle [rad] of this rectangle in the first frame.

        Returns:
            Region and state of the target that was found. The given `region` and `state` where none
            was found, or where they differ from it by no more than noise.
        """
        ...


SMALLEST_SIDE = 4.0
"""Shortest side of a region [px]: a smaller target cannot be recognised."""
LEAST_INSIDE = 0.5
"""Least share of a region's area inside the first image."""
FARTHEST = 1e6
"""Largest absolute value of a region's numbers [px]: products of larger ones would overflow."""


def check_picture(image: object) -> None:
    """Check that an image is an RGB picture, an array (H, W, 3) of uint8 with at least one pixel:
    compiled loops read it without checks of their own.

    Raises:
        ValueError: The image is not such an array.
    """
    if not isinstance(image, np.ndarray):
        raise ValueError(
            f"expected a picture, an array (height, width, 3) of uint8, got {image!r:.40}"
        )
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        shape = " x ".join(map(str, image.shape))
        raise ValueError(
            "expected an RGB picture with at least one pixel, an array (height, width, 3) of "
            f"uint8, got one of {shape} of {image.dtype}"
        )


def check_region(frame: Frame, region: Region, state: State) -> None:
    """Check the arguments of `Tracker.start`: the first picture, and the target's region and state
    in it.

    Raises:
        ValueError: `region` or `state` has the wrong type or a number that is not finite or out of
            range (1e6 px or rad; a scale of exp(-5) to exp(5)); a side of the region at this state
            is shorter than 4 px; less than half of its area is inside the image; or the image is no
            RGB picture, or has more than 16384 px along a side.
    """
    given: list[tuple[object, type]] = [(region, Region), (state, State)]
    for value, kind in given:
        if not isinstance(value, kind):
            raise ValueError(f"Tracker.start expected a {kind.__name__}, got {value!r}")
    check_picture(frame.image)
    height, width = frame.image.shape[:2]
    if max(height, width) > LARGEST_PICTURE:
        raise ValueError(
            f"the picture has {width} x {height} px; the limit is {LARGEST_PICTURE} px a side: "
            "reduce it"
        )
    _check_numbers(region, state)
    sides = (region.width * state.scale, region.height * state.scale)
    if min(sides) < SMALLEST_SIDE:
        raise ValueError(
            f"the region is {sides[0]:.3g} x {sides[1]:.3g} px; "
            f"both sides must be at least {SMALLEST_SIDE:g} px"
        )
    corners = region.corners(state)
    image = np.array([[0, 0], [width, 0], [width, height], [0, height]])
    shared, _ = cv2.intersectConvexConvex(corners.astype(np.float32), image.astype(np.float32))
    if float(shared) < LEAST_INSIDE * region.area(state):
        (left, top) = corners.min(axis=0).round()
        (right, bottom) = corners.max(axis=0).round()
        raise ValueError(
            f"the region spans {left:.6g}..{right:.6g} x {top:.6g}..{bottom:.6g} px; most of it "
            f"must be inside the image of {width} x {height} px"
        )


def _check_numbers(region: Region, state: State) -> None:
    """Check that a region's numbers are finite and at most `FARTHEST`, and that the state's scale
    is in its range.

    Raises:
        ValueError: A number is not finite or too large, or the scale is out of its range.
    """
    if not isinstance(state.scale, Real):
        raise ValueError(f"the state's scale is {state.scale!r}: expected a number")
    numbers = (region.width, region.height, state.x, state.y, state.theta)
    plain = all(isinstance(number, Real) for number in numbers)
    if not plain or not all(abs(number) <= FARTHEST for number in numbers):  # nan is not
        given = ", ".join(f"{number:.6g}" if plain else repr(number) for number in numbers)
        raise ValueError(
            f"the region's width, height, x, y, theta are {given}: expected numbers from "
            f"{-FARTHEST:g} to {FARTHEST:g}"
        )
    least = math.exp(-LARGEST_LOG)
    most = math.exp(LARGEST_LOG)
    if not least <= state.scale <= most:
        raise ValueError(
            f"the region's scale is {state.scale:.6g}: expected {least:.3g} to {most:.3g}"
        )
