"""Target motions, one a file: `Config.build(rng)` gives an object with `at(time) -> Pose`."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.motions")
