"""Estimators of the target's own motion, one module each: `Config.build(rng)` returns an
`Estimator`, which estimates the rate of the feature error that this motion causes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.kinds import Kinds, PartConfig
from sim.plain_part import plain_config

if TYPE_CHECKING:
    from servo.parts import Estimator

KINDS: Kinds[PartConfig[Estimator]] = Kinds(
    __name__,
    "servobench.estimators",
    lambda found: plain_config(found, "start", "update", "skip"),
    "the methods start, update and skip",
)
