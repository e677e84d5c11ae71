"""A class with `init(image, box)` and `update(image)` as one of our trackers."""

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, final, get_args

import numpy as np

from sim.types import Array, Frame
from tracking.external.boxes import Placement, box_of
from tracking.external.conventions import Caller, Convention, Foreign, convention_of, score_in
from tracking.external.judge import Judge, JudgeSettings
from tracking.types import Estimate, Region, State, check_region, unknown_covariance

Score = str | Callable[[Any], float]
"""Attribute or method of a tracker that gives its score, or a function of the tracker."""
DRAWN: dict[str, Callable[[np.random.Generator], Any]] = {
    "rng": lambda rng: rng,
    "seed": lambda rng: int(rng.integers(1 << 31)),
}
"""Arguments that a factory may ask for."""


@dataclass(frozen=True, slots=True)
class Wrapping:
    """A tracker's factory, and how to call what it makes."""

    factory: Any
    convention: Convention | None
    score: Score | None
    name: str

    def make(self, rng: np.random.Generator) -> Foreign:
        """Return a new tracker.

        Raises:
            ValueError: The factory needs arguments, or what it makes lacks a method.
        """
        factory = made = self.factory
        if isinstance(factory, type) or not is_foreign(factory):
            if str(getattr(factory, "__module__", "")).startswith("cv2"):
                factory = getattr(factory, "create", factory)
            made = factory(**self._arguments(factory, rng))
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

    def read_score(self, tracker: Foreign) -> float:
        """Return the tracker's own score, 0..1.

        Raises:
            ValueError: It is not there, or not between 0 and 1.
        """
        if callable(self.score):
            return score_in(self.score(tracker), self.name)
        name = str(self.score)
        if not hasattr(tracker, name):
            raise ValueError(f"{self.name} has no '{name}', which is to give its score")
        found = getattr(tracker, name)
        return score_in(found() if callable(found) else found, self.name)


def is_foreign(tracker: Any) -> bool:
    """Return whether an object, or a class, has the methods `init` and `update`."""
    return all(callable(getattr(tracker, method, None)) for method in ("init", "update"))


@final
class WrappedTracker:
    """A tracker of boxes; it is given neither angle nor camera motion."""

    def __init__(
        self, settings: JudgeSettings, wrapping: Wrapping, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._wrapping = wrapping
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make the tracker and show it the first frame.

        Raises:
            ValueError: The region is none; the tracker cannot be made, refuses the region, or has
                no score though that is to judge.
        """
        check_region(frame, region, state)
        c = self._settings
        w = self._wrapping
        if c.judge == "score" and w.score is None:
            raise ValueError(f'{w.name} has no score: judge = "histogram" needs none')
        made = w.make(self._rng)
        self._caller = Caller(made, w.convention or convention_of(made), w.name)
        box = box_of(region, state, frame.image)
        self._caller.init(frame.image, box)
        self._placement = Placement(region, state, np.array(box, float), sizes=c.follow_size)
        self._judge = Judge(c, frame, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Take over the tracker's box, if it gives one.

        Raises:
            ValueError: The tracker returned something that is no box.
        """
        box = self._caller.update(frame.image)
        if box is None:
            distance, status = self._judge.unseen(frame)
        else:
            self._placement.follow_box(box)
            by_score = self._settings.judge == "score"
            score = self._wrapping.read_score(self._caller.tracker) if by_score else None
            distance, status = self._judge.seen(frame, self._placement.state, score)
        follows = (False, self._placement.resizes)
        return Estimate(self._placement.state, unknown_covariance(), distance, status, follows)


@dataclass(frozen=True)
class WrapSettings(JudgeSettings):
    """Settings of a wrapped tracker."""

    wrapping: ClassVar[Wrapping]

    def build(self, rng: np.random.Generator) -> WrappedTracker:
        """Return the tracker; its seed, if it takes one, is drawn from the generator."""
        return WrappedTracker(self, self.wrapping, rng)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.wrapping, dataclasses.asdict(self))


def wrap(
    factory: Any,
    *,
    convention: Convention | None = None,
    score: Score | None = None,
    judge: Literal["histogram", "score"] | None = None,
    name: str | None = None,
) -> type[WrapSettings]:
    """Return a `Config` class for a tracker of another convention.

    Args:
        factory: Their class, a function that makes one, or one that is made. It may take `seed` or
            `rng`.
        convention: "opencv" (BGR, `update` gives (ok, box) or a box) or "got10k" (RGB arrays, boxes
            counted from 1); None: see `conventions.convention_of`.
        score: Attribute or method of the tracker, or a function of it, that gives its score, 0..1.
        judge: Judge whether the target is seen; None: the score where there is one, else our colour
            histogram.
        name: The kind; None: module:class.

    Raises:
        ValueError: There is no such convention; or the tracker's score is to judge, but none is
            named.

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
    if convention not in (None, *get_args(Convention)):
        there = ", ".join(get_args(Convention))
        raise ValueError(f"{kind}: there is no convention '{convention}'; there is {there}")
    begin = judge or ("score" if score else "histogram")
    if begin == "score" and score is None:
        raise ValueError(f"{kind}: its score is to judge; name it with score=")
    return _config_of(Wrapping(factory, convention, score, kind), begin)


def _config_of(given: Wrapping, begin: Literal["histogram", "score"]) -> type[WrapSettings]:
    @dataclass(frozen=True)
    class Config(WrapSettings):
        kind = given.name
        wrapping = given
        judge: Literal["histogram", "score"] = begin

    return Config


def _again(wrapping: Wrapping, settings: dict[str, Any]) -> WrapSettings:
    """Return unpickled settings, whose class was made by a function."""
    return _config_of(wrapping, settings["judge"])(**settings)
