"""Estimators of the target's own motion, one a file: `Config.build(rng)` gives an `Estimator`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig

if TYPE_CHECKING:
    from servo.parts import Estimator

KINDS: Kinds[PartConfig[Estimator]] = Kinds(__name__, "servobench.estimators")
