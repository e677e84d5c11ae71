"""Package of the targets, one module each: `Config.build(rng)` returns a `Target`, a MuJoCo model
with its reference rectangle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from sim.models.target import Target

KINDS: Kinds[PartConfig[Target]] = Kinds(__name__, "servobench.targets")
