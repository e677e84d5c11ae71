"""A tracker in a process of its own, in any language, over the TraX protocol (Cehovin 2017)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.types import FARTHEST, Region, State
from tracking.wrapped.boxes import Box, box_in, box_of, convex, score_in
from tracking.wrapped.foreign_tracker import ForeignTracker, JudgeSettings
from tracking.wrapped.trax_client import TraxClient

CONFIDENCE = "confidence"
"""Name under which servers report their score."""


@dataclass(frozen=True, slots=True)
class Config(JudgeSettings):
    """The server, and the judge of its regions: its score is the `confidence` it reports."""

    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The server with its arguments, such as "python my_tracker.py"; run without a shell."""
    timeout: Annotated[float, Ge(0.1), Le(3600)] = 30.0
    """Longest wait for an answer [s]; the first one waits for the server's start, too."""

    def build(self, rng: np.random.Generator) -> ForeignTracker:
        """Return the tracker; it draws nothing."""
        return ForeignTracker(self, lambda: TraxServer(self.command, self.timeout))


class TraxServer:
    """A server of the protocol, as a source of regions."""

    def __init__(self, command: str, timeout: float) -> None:
        self._name = f"TraX server '{command}'"
        self._client = TraxClient(command, timeout)

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Show the first picture with the corners, or the box, of the target."""
        box = box_of(region, state, image)
        self._client.initialize(
            image, region.corners(state) if self._client.polygons else np.array(box)
        )
        return box

    def update(self, image: Image) -> Array | None:
        """Ask the server: a box (4,), the corners (4, 2) of a convex quadrilateral, or None.

        Raises:
            ValueError: The server has ended, hangs, or answers something that is no region.
        """
        found, self._named = self._client.frame(image)
        if found is None or found.ndim == 1:
            return None if found is None else box_in(found, self._name)
        if found.shape == (4, 2) and (np.abs(found) <= FARTHEST).all() and convex(found):
            return found
        return box_in(np.concatenate([found.min(axis=0), np.ptp(found, axis=0)]), self._name)

    def score(self) -> float:
        """Return the confidence of the last answer, 0..1.

        Raises:
            ValueError: There is none.
        """
        if CONFIDENCE not in self._named:
            raise ValueError(
                f'{self._name} reports no {CONFIDENCE}: judge = "histogram" needs none'
            )
        return score_in(self._named[CONFIDENCE], self._name)
