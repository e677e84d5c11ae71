"""Failures: of one job, which leaves the others, and of the whole cluster."""

from __future__ import annotations

import traceback
from dataclasses import dataclass

from servo.mistake import FULL, Mistake


class ClusterLost(RuntimeError):
    """A cluster that has stopped working; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a job has no record."""

    error: str
    """The traceback."""
    mistake: str = ""
    """The sentence, where it is the user's mistake or the machine's lack of room."""
    full: bool = False
    """Whether the machine has no more room: the other jobs would fail as well."""

    @staticmethod
    def of(error: BaseException) -> Failure:
        """Describe an error that a job raised."""
        trace = "".join(traceback.format_exception(error))
        if isinstance(error, OSError) and error.errno in FULL:
            return Failure(trace, f"{error.filename}: {error.strerror}", full=True)
        return Failure(trace, str(error) if isinstance(error, Mistake) else "")

    @property
    def reason(self) -> str:
        """The sentence, or the last line of the traceback."""
        return self.mistake or self.error.strip().splitlines()[-1]
