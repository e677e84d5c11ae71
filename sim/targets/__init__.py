"""Targets of the tracker, one per file: `Config.build(rng)` gives a `Target`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from sim.models.target import Target

KINDS: Kinds[PartConfig[Target]] = Kinds(__name__, "servobench.targets")
