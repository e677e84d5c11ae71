"""Package of the disturbances of a run (light, occlusion, a second target, dropped frames), one
module each: `Config.build(rng)` returns an object with `at(time) -> Effect`, and `props`, the names
of the things that it needs in the scene: "second_target" or "spot".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig
from sim.plain_part import plain_config

if TYPE_CHECKING:
    from sim.stage import Disturbance

KINDS: Kinds[PartConfig[Disturbance]] = Kinds(
    __name__,
    "servobench.disturbances",
    lambda found: plain_config(found, "at"),
    "a method at(time)",
)
