"""A part of a run by its place and kind, so that what goes wrong in its code names it."""

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, TypeVar, final

from servo.contracts import BrokenContract, check_built, check_sees, guarded
from servo.mistake import Mistake
from sim.kinds import kind_of

Built = TypeVar("Built")
ENDS = (KeyboardInterrupt, MemoryError)
"""What ends a run from outside, whatever part is at work."""


class PartFailed(Mistake):
    """A sentence that names the part; the exception that it raised is the cause."""


class PartConfig(Protocol):
    """The settings of a part."""

    @property
    def build(self) -> Callable[[Any], Any]:
        """Build it, from a generator of random numbers or, for features, from an outline."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Part:
    """A part of a run: its place in the scenario, such as "tracker", and its `Config`."""

    place: str
    config: PartConfig

    def build(self, given: object) -> Any:
        """Build the part.

        Args:
            given: What its `Config` builds from.

        Raises:
            PartFailed: An exception of its code, or it breaks the contract of its kind.
            Mistake: It refuses its settings with a ValueError.
        """
        with self.naming():
            try:
                built = self.config.build(given)
            except ValueError as error:
                raise Mistake(f"{self.place}: {error}") from error
            check_built(self.kind_of_place, built)
            check_sees(self.config, built)
        return built

    def guarded(self, built: Built, *, checked: bool = True) -> Built:
        """Return what was built so that each of its calls is checked and names the part."""
        return guarded(built, self.kind_of_place, self.naming, checked=checked)

    def naming(self, method: str = "") -> "Naming":
        """Return a context that turns an exception of the part's code into a `PartFailed`.

        Args:
            method: The method that is called in it. A ValueError of `start` refuses the user's
                settings or first picture, so it stays as it is.
        """
        return Naming(self, refuses=method == "start")

    def failed(self, what: str) -> PartFailed:
        """Return the sentence that the part did something."""
        kind = kind_of(self.config)  # a wrapped tracker begins its messages with its own name
        return PartFailed(f"{self.place} '{kind}': {what.removeprefix(f'{kind}: ')}")

    @property
    def kind_of_place(self) -> str:
        """The place without its number in a list: "disturbances" for "disturbances[1]"."""
        return self.place.partition("[")[0]


@final
@dataclass(frozen=True, slots=True)
class Naming:
    """A context that may be entered again, also within itself."""

    part: Part
    refuses: bool

    def __enter__(self) -> None:
        pass

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        passing = (Mistake, *ENDS, ValueError) if self.refuses else (Mistake, *ENDS)
        if error is None or isinstance(error, passing):
            return
        text = str(error)
        spoken = isinstance(error, ValueError | BrokenContract) and text
        what = text if spoken else f"{type(error).__name__}: {text}".removesuffix(": ")
        raise self.part.failed(what) from (None if isinstance(error, BrokenContract) else error)
