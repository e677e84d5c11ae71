"""Tracker in a process of its own, in any language, that reads and writes lines of JSON."""

from dataclasses import dataclass

from tracking.guests.process import ProcessSettings
from tracking.guests.program_client import ProgramClient


@dataclass(frozen=True, slots=True)
class Config(ProcessSettings):
    """Settings of a tracker that is a program: its command, the time limits of its answers, and
    settings of any tracker of another author.
    """

    def guest(self, seed: int) -> ProgramClient:
        """Start the program, send it the seed of its random numbers, wait for its first answer, and
        return the connection to it.

        Raises:
            ValueError: The program does not start, or its first answer is missing or not valid.
        """
        return ProgramClient(self.command, seed, self.timeout, self.loading)
