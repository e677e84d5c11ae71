"""A tracker of another author in a thread of its own, so that a tracker that never answers gives an
error after a time limit; only its thread stays blocked.
"""

import contextvars
import ctypes
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, TypeVar, final

from sim.types import Frame
from tracking.guests.guest import Guest
from tracking.guests.report import Gives, Report
from tracking.types import Region, State

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Call:
    """A function without arguments to call in another thread, and the queue into which that thread
    puts its outcome: the result and None, or None and the exception.
    """

    function: Callable[[], Any]
    outcome: SimpleQueue[tuple[Any, BaseException | None]] = field(default_factory=SimpleQueue)
    """The result and None, or None and what the function raised."""


@final
class TimedGuest:
    """A tracker of another author that is made, by `make`, and called in a thread of its own, with
    limits on the time of its answers: `loading` until it is made and until it has started,
    `timeout` for each picture [s]. `name` begins messages.
    """

    def __init__(
        self, make: Callable[[], Guest], name: str, *, timeout: float, loading: float
    ) -> None:
        """Make the guest in a new thread, which ends with this object.

        Args:
            make: Returns the guest.
            name: What the guest is, to begin messages.
            timeout: Longest wait for the answer to a picture [s].
            loading: Longest wait until the guest is made, and until it has learned the target [s].

        Raises:
            ValueError: The guest cannot be made, or not within the limit.
        """
        self._name = name
        self._timeout = timeout
        self._loading = loading
        self._calls: SimpleQueue[Call | None] = SimpleQueue()
        # A daemon: the interpreter does not wait for it, should the guest never return.
        self._thread = Thread(target=_serve, args=(self._calls,), name=name, daemon=True)
        self._thread.start()
        weakref.finalize(self, self._calls.put, None)
        self._guest = self._limited(make, loading, "loading")

    @property
    def gives(self) -> frozenset[Gives] | None:
        """Which of "size", "angle" and "corners" the tracker declares that it measures besides the
        centre; None: it declares nothing, and its reports show it.
        """
        return self._guest.gives

    @property
    def cuts(self) -> bool:
        """Whether the tracker is shown the region's box cut off at the picture's border."""
        return self._guest.cuts

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Show the tracker the first picture, in which the target is the rectangle `region` [px] at
        `state`.

        Raises:
            ValueError: The tracker refuses the region, or does not return within the limit. Its
                other errors pass unchanged.
        """
        self._limited(lambda: self._guest.start(frame, region, state), self._loading, "loading")

    def update(self, frame: Frame) -> Report:
        """Return the tracker's report on the next picture: whether it sees the target, and where.

        Raises:
            ValueError: The tracker's answer has an invalid form or value, or comes too late. Its
                other errors pass unchanged.
        """
        return self._limited(lambda: self._guest.update(frame), self._timeout, "timeout")

    def _limited(self, function: Callable[[], Result], limit: float, setting: str) -> Result:
        """Return a function's result, which it computes in the guest's thread, or raise what it
        raised.

        Args:
            function: The function.
            limit: Longest wait [s].
            setting: Name of the limit's setting, for the message.

        Raises:
            ValueError: The function did not return within the limit.
        """
        # The thread sees our context, such as NumPy's handling of errors.
        context = contextvars.copy_context()
        call = Call(lambda: context.run(function))
        self._calls.put(call)
        try:
            result, error = call.outcome.get(timeout=limit)
        except Empty:
            self._abandon()
            raise ValueError(
                f"{self._name} did not answer within {limit:g} s: correct the tracker, or set a "
                f"longer tracker.{setting}"
            ) from None
        if error is not None:
            raise error
        return result

    def _abandon(self) -> None:
        """Raise SystemExit in the guest's thread: that ends a loop in Python, which would slow down
        all that follows. A call that never returns to Python stays.
        """
        ident = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, ctypes.py_object(SystemExit))


def _serve(calls: SimpleQueue[Call | None]) -> None:
    """Call the functions in a queue one after the other, and put each one's outcome into its own
    queue, until the queue gives None.
    """
    while (call := calls.get()) is not None:
        try:
            outcome = call.function(), None
        except BaseException as error:
            outcome = None, error
        call.outcome.put(outcome)
        # A result may hold this thread's guest: nothing of the last call is kept while waiting.
        del call, outcome
