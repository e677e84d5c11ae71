"""Package of the robots that carry the camera or the target, one module each: `Config.build(rng)`
returns a `Design`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from sim.kinematics.robot import Design

KINDS: Kinds[PartConfig[Design]] = Kinds(__name__, "servobench.robots")
