"""How a task ended, in this process or in another one, and the error for a lost cluster."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from servo.mistake import Mistake

Task = TypeVar("Task")


class Lost(RuntimeError):
    """A cluster that has stopped working; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended."""

    value: Any
    error: str = ""
    """The traceback of a failure; empty if there was none."""
    mistake: str = ""
    """The sentence of a failure that is the user's mistake; empty otherwise."""

    @property
    def reason(self) -> str:
        """The user's mistake, or the last line of the traceback."""
        return self.mistake or self.error.strip().splitlines()[-1]


def failed(error: BaseException) -> Ended:
    """How a task ended that raised an error."""
    mistake = str(error) if isinstance(error, Mistake) else ""
    return Ended(None, "".join(traceback.format_exception(error)), mistake)


def one_by_one(tasks: Iterable[Task], work: Callable[[Task], Any]) -> Iterator[tuple[Task, Ended]]:
    """Do tasks in this process, one after the other."""
    for task in tasks:
        try:
            ended = Ended(work(task))
        except Exception as error:
            ended = failed(error)
        yield task, ended
