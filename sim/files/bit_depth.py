"""Conversion of 16-bit pictures to 8 bits: many cameras use only 10, 12 or 14 of the 16 bits."""

import numpy as np
from numpy.typing import NDArray

from sim.types import Image

DEEP = 16
USED = (8, 10, 12, 14, DEEP)
"""Numbers of bits that cameras use."""
WHITE = 255


class BitDepth:
    """The number of bits that the 16-bit pictures of one source, such as a camera, use: 8, 10, 12,
    14 or 16. One object is used for all pictures of the source, in their order.

    The number is the smallest of these that holds the largest value of the first picture that is
    not black. It stays the same for all later pictures, so that equal light gives equal grey
    levels.
    """

    used: int | None = None
    """The number of bits; None before the first picture that is not black."""
    notes: tuple[str, ...] = ()
    """A sentence for the user if fewer than 16 bits are used; else empty."""

    def uses_all(self, deep: NDArray[np.uint16]) -> bool:
        """Return True if the source of a uint16 picture (H, W, ...) uses all 16 bits, False if it
        uses fewer. The first picture that is not black decides, and sets `used`; before it the
        result is False.
        """
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
        """Return a uint16 picture (H, W, ...) as uint8: the highest 8 of the bits that its source
        uses. The first picture that is not black determines these bits, and sets `used`; values
        that are too large for them become 255.
        """
        self.uses_all(deep)
        shift = (self.used or DEEP) - 8
        return np.minimum(deep >> shift, WHITE).astype(np.uint8)
