"""Visual feature sets, one module each: `Config.build(outline)` returns a `FeatureSet` for a target
whose reference rectangle has the corners `outline` (4, 3) in its frame [m].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds

if TYPE_CHECKING:
    from servo.parts import FeaturesConfig

KINDS: Kinds[FeaturesConfig] = Kinds(__name__, "servobench.features")
