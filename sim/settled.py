"""Parts that draw nothing: their settings are the part itself."""

from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True, slots=True)
class Settled:
    """Settings that do the work, too."""

    def build(self, rng: np.random.Generator) -> Self:  # noqa: ARG002
        """The part; draws nothing."""
        return self
