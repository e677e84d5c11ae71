"""Tracker in a process of its own, in any language, that reads and writes lines of JSON."""

from dataclasses import dataclass

from tracking.guests.guest import GuestSettings
from tracking.guests.process import Limit
from tracking.guests.program_client import ProgramClient
from tracking.types import Trait


@dataclass(frozen=True, slots=True)
class Config(GuestSettings):
    """The program's command, the time limits of its answers, and settings of any tracker of another
    author.
    """

    traits = frozenset({Trait.FOREIGN})
    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The program with its arguments, such as "python my_tracker.py"; run without a shell."""
    timeout: Limit = 30.0
    """Longest wait for the answer to a picture [s]."""
    loading: Limit = 120.0
    """Longest wait for the program's first line, before which it loads what it needs [s]."""

    def guest(self, seed: int) -> ProgramClient:
        """Return the connection to a new program, which is told the seed."""
        return ProgramClient(self.command, seed, self.timeout, self.loading)
