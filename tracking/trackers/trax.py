"""Tracker in a process of its own, in any language, over the TraX protocol (Cehovin 2017)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from tracking.types import Trait
from tracking.wrapped.foreign_tracker import ForeignTracker, JudgeSettings
from tracking.wrapped.trax_client import TraxClient


@dataclass(frozen=True, slots=True)
class Config(JudgeSettings):
    """The server's command, and settings by which its reported `confidence` is judged."""

    traits = frozenset({Trait.FOREIGN})
    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The server with its arguments, such as "python my_tracker.py"; run without a shell."""
    timeout: Annotated[float, Ge(0.1), Le(3600.0)] = 30.0
    """Longest wait for an answer [s]; the first one waits for the server's start, too."""

    def build(self, rng: np.random.Generator) -> ForeignTracker:
        """Return the tracker; uses no random numbers."""
        return ForeignTracker(self, lambda: TraxClient(self.command, self.timeout))
