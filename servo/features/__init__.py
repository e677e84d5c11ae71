"""Feature sets, one a file: `Config.build(outline)` returns a `FeatureSet`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds

if TYPE_CHECKING:
    from servo.parts import FeaturesConfig

KINDS: Kinds[FeaturesConfig] = Kinds(__name__, "servobench.features")
