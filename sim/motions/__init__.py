"""Package of the target's motions, one module each: `Config.build(rng)` returns an object with
`at(time) -> Pose`, which is T_world_target at a time of the run [s].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig
from sim.plain_part import plain_config

if TYPE_CHECKING:
    from sim.stage import Motion

KINDS: Kinds[PartConfig[Motion]] = Kinds(
    __name__,
    "servobench.motions",
    lambda found: plain_config(found, "at"),
    "a method at(time)",
)
