"""Errors that the code of a run's components raises, turned into messages that name the
component.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, final

from servo.contracts import BrokenContract, check_built, check_sees, guarded
from servo.mistake import Mistake
from sim.kinds import kind_of

Built = TypeVar("Built")
ENDS = (KeyboardInterrupt, MemoryError)
"""Exceptions that are never attributed to a component: they end a run from outside."""


class PartFailed(Mistake):
    """Error: a component of a run, such as the tracker, raised an exception or broke its contract;
    the message names the component.
    """


class PartConfig(Protocol):
    """Settings of a component, such as a tracker; their `build` makes the component."""

    @property
    def build(self) -> Callable[[Any], Any]:
        """Function that makes the component: its argument is a random generator, or for features
        the corners (4, 3) [m] of the target's reference rectangle.
        """
        ...


@final
@dataclass(frozen=True, slots=True)
class Part:
    """A component of a run before it is built: the name of its section in the scenario, such as
    "tracker" or "disturbances[1]", and its settings.
    """

    place: str
    config: PartConfig

    def build(self, given: object) -> Any:
        """Build the component from its settings, check it against its contract, and return it.

        Args:
            given: The argument of the settings' `build`: a random generator, or for features the
                corners (4, 3) [m] of the target's reference rectangle.

        Raises:
            PartFailed: The component's code raised an exception, or the component breaks its
                contract.
            Mistake: The settings' `build` refused them with a ValueError.
        """
        with self.naming():
            try:
                built = self.config.build(given)
            except ValueError as error:
                raise Mistake(f"{self.place}: {error}") from error
            # Checked now, so that a wrong component fails before the run begins.
            check_built(self.kind_of_place, built)
            check_sees(self.kind_of_place, self.config, built)
        return built

    def guarded(self, built: Built, *, checked: bool = True) -> Built:
        """Return a wrapper of the built component that turns exceptions in its methods into
        `PartFailed`, which names the component. A `Mistake`, a KeyboardInterrupt, a MemoryError,
        and a ValueError of `start` pass unchanged.

        Args:
            built: The component.
            checked: Whether the values that the methods return are checked against the contract; an
                invalid one then raises a `PartFailed`.
        """
        return guarded(built, self.kind_of_place, self.blame, checked=checked)

    @contextmanager
    def naming(self) -> Generator[None]:
        """Context manager: turn an exception in the `with` block, which calls the component's code,
        into a `PartFailed` that names the component; a `Mistake`, a KeyboardInterrupt and a
        MemoryError pass unchanged.

        Raises:
            PartFailed: The block raised another exception.
        """
        try:
            yield
        except BaseException as error:
            self.blame(error)
            raise

    def blame(self, error: BaseException, method: str = "") -> None:
        """Raise a `PartFailed` that names this component, for an exception that the component's
        code raised; return without an effect for a `Mistake`, a KeyboardInterrupt, a MemoryError,
        and a ValueError of `start`, by which a component refuses the user's input.

        Args:
            error: The exception.
            method: Name of the component's method that raised it; "" for other code.

        Raises:
            PartFailed: The exception is none of these four.
        """
        if isinstance(error, (Mistake, *ENDS)):
            return
        if isinstance(error, BrokenContract):
            raise self.failed(str(error)) from None
        if isinstance(error, ValueError) and method in ("start", "outline"):
            return
        text = str(error)
        if not isinstance(error, ValueError) or not text:  # also SystemExit: it must not end us
            text = f"{type(error).__name__}: {text}".removesuffix(": ")
        raise self.failed(text) from error

    def failed(self, what: str) -> PartFailed:
        """Return, without raising it, an error whose message is the component's section and kind,
        followed by a sentence.

        Args:
            what: The sentence: what went wrong.
        """
        kind = kind_of(self.config)  # a wrapped tracker begins its messages with its own name
        return PartFailed(f"{self.place} '{kind}': {what.removeprefix(f'{kind}: ')}")

    @property
    def kind_of_place(self) -> str:
        """Name of the component's section in the scenario without an index: "disturbances" for
        "disturbances[1]".
        """
        return self.place.partition("[")[0]
