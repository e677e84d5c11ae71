"""Tracker in a process of its own, in any language, over the TraX protocol (Cehovin 2017)."""

from dataclasses import dataclass

from tracking.guests.process import ProcessSettings
from tracking.guests.trax_client import TraxClient


@dataclass(frozen=True, slots=True)
class Config(ProcessSettings):
    """Settings of a tracker that is a server of TraX: its command, the time limits of its answers,
    and settings of any tracker of another author.
    """

    def guest(self, seed: int) -> TraxClient:
        """Start the TraX server, wait for its first message, and return the connection to it.
        `seed` is not used, because TraX has no message for it.

        Raises:
            ValueError: The server does not start, sends no hello (first message), or does not
                accept our messages.
        """
        return TraxClient(self.command, self.timeout, self.loading)
