"""Controllers, one a file: `Config.build(rng)` gives a function from an `Estimator` to a
`Controller`.
"""

from typing import Any

from sim.kinds import Kinds

KINDS = Kinds[Any](__name__, "servobench.controllers")
