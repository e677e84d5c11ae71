"""Tracker in a process of its own, in any language, over the TraX protocol (Cehovin 2017)."""

from dataclasses import dataclass

from tracking.guests.guest import GuestSettings
from tracking.guests.process import Limit
from tracking.guests.trax_client import TraxClient
from tracking.types import Trait


@dataclass(frozen=True, slots=True)
class Config(GuestSettings):
    """The server's command, the time limits of its answers, and settings of any tracker of another
    author.
    """

    traits = frozenset({Trait.FOREIGN})
    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The server with its arguments, such as "python my_tracker.py"; run without a shell."""
    timeout: Limit = 30.0
    """Longest wait for the answer to a picture [s]."""
    loading: Limit = 120.0
    """Longest wait for the server's hello, before which it loads what it needs [s]."""

    def guest(self, seed: int) -> TraxClient:
        """Return the connection to a new server, which is not told the seed."""
        return TraxClient(self.command, self.timeout, self.loading)
