"""Wrapping of a class with `init(image, box)` and `update(image)` as a `tracking.types.Tracker`.

The class follows one of two conventions:

| | OpenCV | GOT-10k |
|---|---|---|
| picture | BGR | RGB |
| box given to `init` | whole numbers, pixels counted from 0 | array (4,), pixels counted from 1 |
| answer of `update` | (ok, box), a box or a mapping | a box or a mapping |

A mapping has the keys of `tracking.guests.report.KEYS`: box, angle, corners, seen, confidence.
"""

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, TypeGuard, final, get_args

import cv2
import numpy as np

from sim.plain_part import DRAWN, has_methods
from sim.types import Array, Frame, Image
from tracking.guests.boxes import exact_box, whole_box
from tracking.guests.cv2_tracker import seed_opencv
from tracking.guests.guest import GuestSettings
from tracking.guests.own_thread import TimedGuest
from tracking.guests.report import DIGITS, Gives, Report, confidence_in, gives_in, report_in
from tracking.types import Region, State

Convention = Literal["opencv", "got10k"]
Confidence = str | Callable[[Any], float]
"""Name of the tracker's attribute or method with its confidence 0..1, or a function of the tracker
that returns the confidence."""
BOXES = {"box", "bbox"}
"""Names of the second argument of `init` by which GOT-10k's convention is recognised."""
FROM_ONE = np.array([1.0, 1.0, 0.0, 0.0])
"""What a box gains where pixels are counted from 1."""


class Foreign(Protocol):
    """Protocol of a tracker of another author, in OpenCV's or GOT-10k's convention: `init` is
    called once with the first picture, then `update` with each further one.
    """

    def init(self, image: Any, box: Any, /) -> object:
        """Learn the target in a box of left, top, width, height [px] of the first picture (H, W,
        3); return False to refuse the box. Other results are ignored.
        """

    def update(self, image: Any, /) -> object:
        """Return the target's box of left, top, width, height [px] in the next picture (H, W, 3),
        (ok, box), or a mapping with some of the keys box, angle [rad], corners, seen and
        confidence.
        """


@final
class Called:
    """A tracker of another author in this process, called with OpenCV's pictures and boxes (BGR,
    whole numbers) or GOT-10k's (RGB, pixels counted from 1). With `rounds`, its boxes are corrected
    for the rounding of the box that its `init` was given.
    """

    cuts = True
    """The tracker is shown the box around the region cut off at the picture's border."""

    def __init__(
        self,
        tracker: Foreign,
        convention: Convention,
        name: str,
        confidence: Confidence | None,
        *,
        rounds: bool,
    ) -> None:
        """Connect a tracker.

        Args:
            tracker: The tracker.
            convention: How it is called.
            name: Its name, to begin messages.
            confidence: Where its confidence is found; None: only in its answers, if at all.
            rounds: Whether its boxes have the error of the whole numbers that `init` was given, as
                those of OpenCV's own trackers have; the error is then taken out.

        Raises:
            ValueError: The tracker's attribute `gives` has something unknown in it.
        """
        self._tracker = tracker
        self._convention = convention
        self._name = name
        self._confidence = confidence
        self._rounds = rounds
        self.gives: frozenset[Gives] | None = gives_in(getattr(tracker, "gives", None), name)
        """What the tracker's attribute `gives` declares that it measures; None: it has none."""

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Start the tracker on the first picture with the upright box around the rectangle `region`
        [px] at `state`, cut to the picture; in whole numbers by OpenCV's convention.

        Raises:
            ValueError: The tracker's `init` returned False.
        """
        exact = exact_box(region, state, frame.image)
        whole = np.array(whole_box(exact), dtype=float)
        self._given = exact, whole
        given = whole_box(exact) if self._convention == "opencv" else exact + FROM_ONE
        if self._tracker.init(self._picture(frame.image), given) is False:
            box = whole_box(exact)
            raise ValueError(
                f"{self._name}: init refused the region x, y, width, height = {box}: give another "
                "region"
            )

    def update(self, frame: Frame) -> Report:
        """Return the tracker's report on the next picture: whether it sees the target, and the box
        or corners [px] where it sees it.

        Raises:
            ValueError: The tracker's `update` returned something else than `report_in` accepts, or
                its confidence is missing or is not a number from 0 to 1.
        """
        report = report_in(self._tracker.update(self._picture(frame.image)), self._name)
        if self._convention == "got10k":
            report = _shifted(report)
        if self._rounds and report.box is not None:
            report = dataclasses.replace(report, box=_unrounded(report.box, *self._given))
        if self._confidence is None:
            return report
        return dataclasses.replace(report, confidence=self._sure(self._confidence))

    def _sure(self, where: Confidence) -> float:
        """Return the confidence 0..1 that the tracker has after its last answer.

        Raises:
            ValueError: The tracker has no such attribute, or its value is not possible.
        """
        if callable(where):
            return confidence_in(where(self._tracker), self._name)
        if not hasattr(self._tracker, where):
            raise ValueError(
                f"{self._name} has no attribute or method '{where}', but confidence= names it: "
                "correct the name"
            )
        found = getattr(self._tracker, where)
        return confidence_in(found() if callable(found) else found, self._name)

    def _picture(self, image: Image) -> Image:
        """Return a copy of an RGB picture in the tracker's channel order; the tracker may keep and
        change the copy.
        """
        if self._convention == "opencv":
            return cv2.cvtColor(image, cv2.COLOR_RGB2BGR).astype(np.uint8, copy=False)
        return np.array(image, order="C")


def _shifted(report: Report) -> Report:
    """Return a report whose pixels are counted from 0 for one in which they are counted from 1."""
    box = None if report.box is None else (report.box - FROM_ONE).round(DIGITS)
    corners = None if report.corners is None else (report.corners - 1).round(DIGITS)
    return dataclasses.replace(report, box=box, corners=corners)


def _unrounded(box: Array, exact: Array, whole: Array) -> Array:
    """Return a box (4,) [px] moved and scaled as the exact first box is relative to the one of
    whole numbers.
    """
    sides = box[2:] * exact[2:] / whole[2:]
    centre = box[:2] + box[2:] / 2
    moved = centre + exact[:2] + exact[2:] / 2 - whole[:2] - whole[2:] / 2
    return np.concatenate([moved - sides / 2, sides]).round(DIGITS)


def convention_of(tracker: Foreign) -> Convention:
    """Return how the methods of a tracker of another author want to be called: "got10k" (RGB,
    pixels counted from 1) for a subclass of that toolkit's `Tracker`, and where the second argument
    of `init` is named box or bbox; else "opencv" (BGR, pixels counted from 0).
    """
    if any(base.__module__.startswith("got10k.") for base in type(tracker).__mro__):
        return "got10k"
    try:
        names = list(inspect.signature(tracker.init).parameters)
    except (TypeError, ValueError):  # compiled, such as OpenCV's own
        return "opencv"
    return "got10k" if BOXES & set(names[1:2]) else "opencv"


@dataclass(frozen=True, slots=True)
class Wrapping:
    """A class or function that makes trackers of another author, or one such tracker; the
    convention of its methods (None: as `convention_of` finds it); where its confidence is found
    (None: only in its answers, if at all); its name in messages; and whether it is one of OpenCV's
    own (`rounds`).
    """

    factory: Any
    """The class, the function, or a tracker that is made already."""
    convention: Convention | None
    """None: `convention_of` decides."""
    confidence: Confidence | None
    name: str
    """Name of the tracker, for messages."""
    rounds: bool = False
    """Whether the tracker is one of OpenCV's own (see `Called`)."""

    def timed(self, seed: int, settings: GuestSettings) -> TimedGuest:
        """Return a new tracker, ready for the first picture, in a thread of its own, whose answers
        have time limits.

        Args:
            seed: Seed of all random numbers of the tracker.
            settings: Settings with the time limits `timeout` and `loading` [s].

        Raises:
            ValueError: The tracker cannot be made (see `called`), or not within
                `settings.loading`.
        """
        limits = {"timeout": settings.timeout, "loading": settings.loading}
        return TimedGuest(lambda: self.called(seed), self.name, **limits)

    def called(self, seed: int) -> Called:
        """Return a tracker, ready for the first picture: a new one of the class or function, which
        gets `seed`, or `rng` with this seed, if it has such an argument; or the tracker that
        `factory` is. For a new one, OpenCV's random numbers and the C library's rand() are seeded
        in the whole process.

        Raises:
            ValueError: The class needs arguments or makes no tracker, or the tracker's attribute
                `gives` has something unknown in it.
        """
        made, is_opencvs = self._made(seed)
        convention = self.convention or convention_of(made)
        rounds = self.rounds or is_opencvs
        return Called(made, convention, self.name, self.confidence, rounds=rounds)

    def _made(self, seed: int) -> tuple[Foreign, bool]:
        """Return a tracker, and whether its class is one of OpenCV's own.

        Raises:
            ValueError: The class or function needs arguments, or what it makes is no tracker.
        """
        factory = made = self.factory
        is_opencvs = False
        if isinstance(factory, type) or not is_foreign(factory):
            is_opencvs = str(getattr(factory, "__module__", "")).startswith("cv2")
            if is_opencvs:
                factory = getattr(factory, "create", factory)
            arguments = self._arguments(factory, seed)
            seed_opencv(seed)
            made = factory(**arguments)
        if not is_foreign(made):
            raise ValueError(
                f"{self.name}: {type(made).__name__} lacks init(image, box) or update(image): give "
                "it both methods"
            )
        return made, is_opencvs

    def _arguments(self, factory: Callable[..., Any], seed: int) -> dict[str, Any]:
        """Return, by name, those of the arguments `rng` and `seed` that a class or function has.

        Raises:
            ValueError: The class or function needs other arguments.
        """
        try:
            taken = inspect.signature(factory).parameters.values()
        except (TypeError, ValueError):  # compiled, such as OpenCV's own
            return {}
        variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
        needed = [p.name for p in taken if p.default is p.empty and p.kind not in variable]
        if unknown := [name for name in needed if name not in DRAWN]:
            raise ValueError(
                f"{self.name} needs the arguments {', '.join(unknown)}: give wrap a function that "
                "needs none, such as lambda: Tracker(...)"
            )
        drawn = {"rng": np.random.default_rng(seed), "seed": seed}
        return {p.name: drawn[p.name] for p in taken if p.name in drawn}


def is_foreign(tracker: object) -> TypeGuard[Foreign]:
    """Return True if an object or a class has the methods `init` and `update`."""
    return has_methods(tracker, "init", "update")


@dataclass(frozen=True)
class WrapSettings(GuestSettings):
    """Settings of a tracker that `wrap` makes of a class of another author (`wrapping`): those of
    any tracker of another author.
    """

    wrapping: ClassVar[Wrapping]

    def guest(self, seed: int) -> TimedGuest:
        """Return the tracker of the other author in a thread of its own, ready for the first
        picture: a new one of a wrapped class or function, or the wrapped object. A new one gets
        `seed`, or `rng` with this seed, if it has such an argument; OpenCV's random numbers and C's
        rand() are then seeded in the whole process.

        Raises:
            ValueError: The tracker cannot be made, or not within the setting `loading` [s].
        """
        return self.wrapping.timed(seed, self)

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (self.wrapping, dataclasses.asdict(self))


def wrap(
    factory: Any,
    *,
    convention: Convention | None = None,
    confidence: Confidence | None = None,
    name: str | None = None,
) -> type[WrapSettings]:
    """Return a `Config` class whose `build(rng)` makes a `tracking.types.Tracker` of a class of
    another author, written for OpenCV or GOT-10k.

    Args:
        factory: The tracker's class, a function that makes a tracker, or a tracker. Class and
            function may take `seed` or `rng`. OpenCV's own generator is seeded before the call. An
            attribute `gives` of the tracker, such as {"size"}, declares what it measures besides
            the centre ("size", "angle", "corners"); without it the answers show it.
        convention: "opencv" (BGR, `update` gives (ok, box) or a box) or "got10k" (RGB arrays, boxes
            counted from 1); None: see `convention_of`.
        confidence: Name of the tracker's attribute or method with its confidence 0..1, or a
            function of the tracker that returns it; None: only its answers have one, if at all.
        name: Name of the kind in results and messages; None: "module:class".

    Raises:
        ValueError: `factory` is neither callable nor a tracker, or there is no such convention.

    Example:
        >>> class Still:
        ...     def init(self, image, rect):
        ...         self.rect = rect
        ...
        ...     def update(self, image):
        ...         return True, self.rect
        >>> Config = wrap(Still, name="still")
        >>> Config.kind, Config().judge
        ('still', 'own')
    """
    of = factory if hasattr(factory, "__qualname__") else type(factory)
    kind = name or ":".join(filter(None, (of.__module__, of.__qualname__)))
    if not callable(factory) and not is_foreign(factory):
        raise ValueError(
            f"{factory!r} is not a tracker: expected a class or object with methods init and "
            "update, or a function that returns one"
        )
    if convention not in (None, *get_args(Convention)):
        there = ", ".join(get_args(Convention))
        raise ValueError(
            f"{kind}: there is no convention '{convention}' of pictures and boxes; known are "
            f"{there}"
        )
    return _config_of(Wrapping(factory, convention, confidence, kind))


def _config_of(given: Wrapping) -> type[WrapSettings]:
    @dataclass(frozen=True)
    class Config(WrapSettings):
        kind = given.name
        wrapping = given

    return Config


def _again(wrapping: Wrapping, settings: dict[str, Any]) -> WrapSettings:
    """Return settings from a pickle, which cannot name their class: `wrap` made it."""
    return _config_of(wrapping)(**settings)
