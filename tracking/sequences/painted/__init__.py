"""Package of the kinds of painted (synthetic) sequences with exact truth, one module each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from tracking.sequences.sequence import Sequence

KINDS: Kinds[PartConfig[Sequence]] = Kinds(__name__)
