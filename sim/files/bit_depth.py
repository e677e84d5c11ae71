"""Pictures of 16 bits as such of 8: many cameras use only 10, 12 or 14 of the 16."""

import numpy as np
from numpy.typing import NDArray

from sim.types import Image

DEEP = 16
USED = (8, 10, 12, 14, DEEP)
"""Bits that cameras use."""
WHITE = 255


class BitDepth:
    """The bits in use in the pictures of one source: the fewest of `USED` that hold the largest
    value of the first picture of 16 bits which is not black. They are kept for all pictures, so
    that the same brightness keeps its value.
    """

    used: int | None = None
    """None until there was such a picture."""
    notes: tuple[str, ...] = ()
    """A sentence for the user, if fewer than 16 bits are used."""

    def uses_all(self, deep: NDArray[np.uint16]) -> bool:
        """Return whether all 16 bits are used, in the source of a picture (H, W, ...), uint16."""
        largest = int(deep.max(initial=0))
        if self.used is None and largest > 0:
            self.used = next(bits for bits in USED if largest < 1 << bits)
            if self.used < DEEP:
                self.notes = (
                    f"the pictures have 16 bits, of which {self.used} are used: the largest value "
                    f"of the first is {largest}; later ones are clipped at {(1 << self.used) - 1}",
                )
        return self.used == DEEP

    def reduced(self, deep: NDArray[np.uint16]) -> Image:
        """Return a picture (H, W, ...), uint16, by the highest 8 of the bits in use, as uint8."""
        self.uses_all(deep)
        shift = (self.used or DEEP) - 8
        return np.minimum(deep >> shift, WHITE).astype(np.uint8)
