"""Estimators of the target's own motion, one a file: `Config.build(rng)` gives an `Estimator`."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.estimators")
