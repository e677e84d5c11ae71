"""Objects to be followed, one a file: `Config.build(rng)` gives a `Target`."""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.targets")
