"""Wrapping of a class with `init(image, box)` and `update(image)` as a `tracking.types.Tracker`.

The class follows one of two conventions:

| | OpenCV | GOT-10k |
|---|---|---|
| picture | BGR | RGB |
| box | integers x, y, width, height, pixels counted from 0 | array (4,), pixels counted from 1 |
| answer of `update` | (ok, box) or a box | a box |
"""

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, TypeGuard, get_args

import cv2
import numpy as np

from sim.plain_part import DRAWN, has_methods
from sim.types import Array, Image
from tracking.types import Region, State
from tracking.wrapped.boxes import Box, box_in, box_of, score_in
from tracking.wrapped.cv2_tracker import seed_opencv
from tracking.wrapped.foreign_tracker import ForeignTracker, JudgeSettings

Convention = Literal["opencv", "got10k"]
Score = str | Callable[[Any], float]
"""Name of the tracker's attribute or method with its score 0..1, or a function of the tracker that
returns the score."""
BOXES = {"box", "bbox"}
"""Names of the second argument of `init` by which GOT-10k's convention is recognised."""


class Foreign(Protocol):
    """A tracker of another author, in OpenCV's or GOT-10k's convention."""

    def init(self, image: Any, box: Any, /) -> object:
        """Learn the target in a box of the first picture; return False to refuse the box."""

    def update(self, image: Any, /) -> object:
        """Find the target in the next picture; return its box [px], or (ok, box)."""


@dataclass(frozen=True, slots=True)
class Caller:
    """A `RegionSource` that calls a tracker of another author in its own convention."""

    tracker: Foreign
    convention: Convention
    name: str
    """Name of the tracker, for messages."""
    score_of: Score | None

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Start the tracker on the first picture, RGB (H, W, 3), with the box around a region.

        Returns:
            The box x, y, width, height [px], pixels counted from 0.

        Raises:
            ValueError: The tracker's `init` returned False.
        """
        box = box_of(region, state, image)
        given = box if self.convention == "opencv" else np.array(box, dtype=float) + (1, 1, 0, 0)
        if self.tracker.init(self._picture(image), given) is False:
            raise ValueError(f"{self.name}: init refused the region x, y, width, height = {box}")
        return box

    def update(self, image: Image) -> Array | None:
        """Return the target's box (4,) x, y, width, height [px] in the next picture, RGB (H, W, 3);
        None where the target is not seen. Pixels are counted from 0.

        Raises:
            ValueError: The tracker's `update` returned something else than a box or (ok, box).
        """
        box = box_in(self.tracker.update(self._picture(image)), self.name)
        return box if box is None or self.convention == "opencv" else box - (1, 1, 0, 0)

    def score(self) -> float:
        """Return how sure the tracker itself is of its last answer, from 0 (lost) to 1 (certain).

        Raises:
            ValueError: The tracker has no score, or the score is not a number of 0 to 1.
        """
        if callable(self.score_of):
            return score_in(self.score_of(self.tracker), self.name)
        name = str(self.score_of)
        if not hasattr(self.tracker, name):
            raise ValueError(
                f"{self.name} has no attribute or method '{name}', but score= names it as its score"
            )
        found = getattr(self.tracker, name)
        return score_in(found() if callable(found) else found, self.name)

    def _picture(self, image: Image) -> Image:
        """Return a copy of an RGB picture in the tracker's channel order; the tracker may keep and
        change the copy.
        """
        if self.convention == "opencv":
            return cv2.cvtColor(image, cv2.COLOR_RGB2BGR).astype(np.uint8, copy=False)
        return np.array(image, order="C")


def convention_of(tracker: Foreign) -> Convention:
    """Return the convention of a tracker: GOT-10k's for a subclass of that toolkit's `Tracker`, and
    where the second argument of `init` is named box or bbox; else OpenCV's.
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
    """A class or function that makes trackers of another author, and how to call them."""

    factory: Any
    """The class, the function, or a tracker that is made already."""
    convention: Convention | None
    """None: `convention_of` decides."""
    score: Score | None
    name: str
    """Name of the tracker, for messages."""

    def build(self, settings: JudgeSettings, rng: np.random.Generator) -> ForeignTracker:
        """Return a `tracking.types.Tracker` around a new tracker of the other author, whose random
        seed is drawn from a generator.
        """
        return ForeignTracker(settings, lambda: self._caller(settings, rng))

    def _caller(self, settings: JudgeSettings, rng: np.random.Generator) -> Caller:
        if settings.judge == "score" and self.score is None:
            raise ValueError(f'{self.name} has no score; set judge = "histogram", which needs none')
        made = self._made(rng)
        return Caller(made, self.convention or convention_of(made), self.name, self.score)

    def _made(self, rng: np.random.Generator) -> Foreign:
        factory = made = self.factory
        if isinstance(factory, type) or not is_foreign(factory):
            if str(getattr(factory, "__module__", "")).startswith("cv2"):
                factory = getattr(factory, "create", factory)
            arguments = self._arguments(factory, rng)
            seed_opencv(DRAWN["seed"](rng.spawn(1)[0]))
            made = factory(**arguments)
        if not is_foreign(made):
            raise ValueError(
                f"{self.name}: {type(made).__name__} lacks init(image, box) or update(image)"
            )
        return made

    def _arguments(self, factory: Callable[..., Any], rng: np.random.Generator) -> dict[str, Any]:
        try:
            taken = inspect.signature(factory).parameters.values()
        except (TypeError, ValueError):  # compiled, such as OpenCV's own
            return {}
        variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
        needed = [p.name for p in taken if p.default is p.empty and p.kind not in variable]
        if unknown := [name for name in needed if name not in DRAWN]:
            raise ValueError(
                f"{self.name} needs {', '.join(unknown)}: give wrap a function without arguments, "
                "such as lambda: Tracker(...)"
            )
        return {p.name: DRAWN[p.name](rng) for p in taken if p.name in DRAWN}


def is_foreign(tracker: object) -> TypeGuard[Foreign]:
    """Return True if an object or a class has the methods `init` and `update`."""
    return has_methods(tracker, "init", "update")


@dataclass(frozen=True)
class WrapSettings(JudgeSettings):
    """Settings of a tracker that `wrap` makes of a class of another author."""

    wrapping: ClassVar[Wrapping]

    def build(self, rng: np.random.Generator) -> ForeignTracker:
        """Return a new tracker; if its class takes a seed, the seed is drawn from the generator."""
        return self.wrapping.build(self, rng)

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (self.wrapping, dataclasses.asdict(self))


def wrap(
    factory: Any,
    *,
    convention: Convention | None = None,
    score: Score | None = None,
    judge: Literal["histogram", "score"] | None = None,
    name: str | None = None,
) -> type[WrapSettings]:
    """Return a `Config` class whose `build(rng)` makes a `tracking.types.Tracker` of a class of
    another author, written for OpenCV or GOT-10k.

    Args:
        factory: The tracker's class, a function that makes a tracker, or a tracker. Class and
            function may take `seed` or `rng`. OpenCV's own generator is seeded before the call.
        convention: "opencv" (BGR, `update` gives (ok, box) or a box) or "got10k" (RGB arrays, boxes
            counted from 1); None: see `convention_of`.
        score: Name of the tracker's attribute or method with its score 0..1, or a function of the
            tracker that returns the score; None: it has none.
        judge: "score" to decide by the tracker's score whether the target is seen, "histogram" to
            decide by our colour histogram; None: by the score if `score` is given.
        name: Name of the kind in results and messages; None: "module:class".

    Raises:
        ValueError: `factory` is not a tracker; there is no such convention; or `judge` is "score"
            without `score`.

    Example:
        >>> class Still:
        ...     def init(self, image, rect):
        ...         self.rect = rect
        ...
        ...     def update(self, image):
        ...         return True, self.rect
        >>> Config = wrap(Still, name="still")
        >>> Config.kind, Config().judge
        ('still', 'histogram')
    """
    of = factory if hasattr(factory, "__qualname__") else type(factory)
    kind = name or ":".join(filter(None, (of.__module__, of.__qualname__)))
    if not callable(factory) and not is_foreign(factory):
        raise ValueError(
            f"{factory!r} is not a tracker: expected methods init and update, or a function that "
            "returns a tracker"
        )
    if convention not in (None, *get_args(Convention)):
        there = ", ".join(get_args(Convention))
        raise ValueError(f"{kind}: there is no convention '{convention}'; there is {there}")
    begin = judge or ("score" if score else "histogram")
    if begin == "score" and score is None:
        raise ValueError(f'{kind}: judge="score" needs score=, the name of the tracker\'s score')
    return _config_of(Wrapping(factory, convention, score, kind), begin)


def _config_of(given: Wrapping, begin: Literal["histogram", "score"]) -> type[WrapSettings]:
    @dataclass(frozen=True)
    class Config(WrapSettings):
        kind = given.name
        wrapping = given
        judge: Literal["histogram", "score"] = begin

    return Config


def _again(wrapping: Wrapping, settings: dict[str, Any]) -> WrapSettings:
    """Return settings from a pickle, which cannot name their class: `wrap` made it."""
    return _config_of(wrapping, settings["judge"])(**settings)
