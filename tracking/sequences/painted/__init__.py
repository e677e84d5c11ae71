"""Package of the kinds of painted (synthetic) sequences, one module each. The target's corners and
states in their pictures are known exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from tracking.sequences.sequence import Sequence

KINDS: Kinds[PartConfig[Sequence]] = Kinds(__name__)
